"""Errors of a stream, with a remedy for each."""

from common.errors import ExitCode, UserError
from console.receiver.address import StreamAddress


class StreamError(UserError):
    """The stream can't be received, or it ended.

    Args:
        what: what happened.
        remedy: what to do.
        final: whether a further attempt with the same address can't help.
    """

    def __init__(self, what: str, remedy: str, *, final: bool = False) -> None:
        super().__init__(what, remedy, exit_code=ExitCode.UNREACHABLE)
        self.final = final


class StreamEndedError(StreamError):
    """The robot ended the connection, or it was lost."""


class StreamRefusedError(StreamError):
    """The connection was never established."""


class NoPictureError(StreamError):
    """Packets arrive, but no whole picture, over one connection after the other."""


class ReceiverFailedError(StreamError):
    """A defect of the receiver itself, which may recur with the next connection."""


class UndecodableError(StreamError):
    """The stream arrives, but this computer can't decode it."""


def from_srt(address: StreamAddress, detail: str, *, had_data: bool) -> StreamError:
    """Translates an error of the SRT source.

    Args:
        address: listener of the connection.
        detail: the source's own text; libsrt's reason is the part after the last line break.
        had_data: whether anything had arrived over this connection.
    """
    reason = detail.strip().rsplit("\n", maxsplit=1)[-1]
    if "assword" in reason or "passphrase" in reason.lower():
        return StreamRefusedError(
            f"{address.uri} did not accept the passphrase"
            if address.passphrase
            else f"{address.uri} asks for a passphrase",
            "Type: robotctl login. The robot gives each session's passphrase to authenticated clients, or, "
            "without credentials, to clients on the robot itself and in tunnels",
            final=True,
        )
    if had_data:
        return ended(address, reason)
    return StreamRefusedError(
        f"no SRT listener answers at {address.uri} ({reason})",
        "Switch the preview on (robotctl preview on) and let UDP through to that port",
    )


def unresolved(address: StreamAddress, error: OSError) -> StreamError:
    """Returns the error of a host without an address."""
    return StreamRefusedError(
        f"no stream from {address.uri}: the name does not resolve: {error.strerror or error}",
        f"Use the robot's address instead of its name, or type: getent hosts {address.host}",
    )


def no_socket(address: StreamAddress, why: str, remedy: str) -> StreamError:
    """Returns the error of a computer that gives no socket, so that nothing was sent."""
    return StreamError(f"no stream from {address.uri}: {why}", remedy)


def hung(within_s: float) -> StreamError:
    """Returns the error of a connection that can't be closed, as with a driver that hangs."""
    return StreamError(
        f"the receiver did not stop within {within_s:g} s",
        "Another one takes its place; if it happens again, close the window and open it again",
    )


def hung_too_often(times: int) -> StreamError:
    """Returns the error of the last connection of that kind."""
    return StreamError(
        f"{times} receivers did not stop, as with a decoder's driver that hangs",
        "Close the window and open it again",
        final=True,
    )


def ended(address: StreamAddress, reason: str = "") -> StreamEndedError:
    """Returns the error of a stream that was received and then ended."""
    why = f" ({reason})" if reason else ""
    return StreamEndedError(
        f"the stream from {address.uri} ended{why}",
        "The robot ended it or the connection was lost: look at robotctl status",
    )


def receiver_failed(error: Exception) -> ReceiverFailedError:
    """Returns the error of a defect of the receiver itself."""
    return ReceiverFailedError(
        f"the receiver itself failed: {error!r}",
        "Another one takes its place; the terminal has the details for a report",
    )


def undecodable(address: StreamAddress, content: str) -> UndecodableError:
    """Returns the error of a stream that arrives but can't be decoded.

    Args:
        address: listener of the connection.
        content: what it sends, or the decoder's own text.
    """
    return UndecodableError(
        f"{address.uri} sends {content}, which this receiver can't decode",
        "Check that this is the robot's preview port: H.264 or H.265 in an MPEG transport stream is expected",
        final=True,
    )


def no_picture(address: StreamAddress, for_s: float) -> NoPictureError:
    """Returns the error of a stream of which too little arrives."""
    return NoPictureError(
        f"packets come from {address.uri}, but no whole picture for {for_s:.0f} s",
        "The link loses too many of them, as one does that is narrower than the stream. "
        "Type: robotctl preview on --profile low-bw",
    )


def no_frame_within(address: StreamAddress, timeout_s: float) -> StreamError:
    """Returns the error of a timeout."""
    return StreamError(
        f"no frame from {address.uri} within {timeout_s:g} s",
        "Check robotctl status: is the preview RUNNING, does it encode frames, is a passphrase needed",
    )
