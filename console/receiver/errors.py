"""What can go wrong with a stream, in words for a person."""

from common.errors import ExitCode, UserError
from console.receiver.address import StreamAddress


class StreamError(UserError):
    """The stream does not come, or came and ended.

    Args:
        what: what happened.
        remedy: what to do.
        final: whether trying again with the same address can't help.
    """

    def __init__(self, what: str, remedy: str, *, final: bool = False) -> None:
        super().__init__(what, remedy, exit_code=ExitCode.UNREACHABLE)
        self.final = final


class NoPictureError(StreamError):
    """No picture in the time the caller gave. The receiver goes on; asking again is fine."""


class StreamEndedError(StreamError):
    """The connection is over: the robot ended it, or it was lost."""


class StreamRefusedError(StreamError):
    """The connection never came about."""


class UndecodableError(StreamError):
    """The stream arrives, but this machine can't make pictures of it."""


class ReceiverClosedError(StreamError):
    """The receiver was closed while, or before, somebody waited for a picture."""


def closed() -> ReceiverClosedError:
    """There will be no more pictures, because the caller wanted no more."""
    return ReceiverClosedError("the receiver is closed", "Make a new one", final=True)


def from_srt(address: StreamAddress, detail: str, *, had_data: bool) -> StreamError:
    """What an error of the SRT source means.

    Args:
        address: what was called.
        detail: the source's own words; libsrt's reason is the part after the last line break.
        had_data: whether anything had arrived over this connection.
    """
    reason = detail.strip().rsplit("\n", maxsplit=1)[-1]
    if "assword" in reason or "passphrase" in reason.lower():
        return StreamRefusedError(
            f"{address.uri} did not accept the passphrase"
            if address.passphrase
            else f"{address.uri} asks for a passphrase",
            "Take this session's from the endpoint that an authenticated client gets",
            final=True,
        )
    if had_data:
        return ended(address, reason)
    return StreamRefusedError(
        f"no SRT listener answers at {address.uri} ({reason})",
        "Switch the preview on (robotctl preview on) and let UDP through to that port",
    )


def ended(address: StreamAddress, reason: str = "") -> StreamEndedError:
    """The stream was there and is over."""
    why = f" ({reason})" if reason else ""
    return StreamEndedError(
        f"the stream from {address.uri} ended{why}",
        "The robot ended it or the connection was lost: look at robotctl status",
    )


def nothing_within(address: StreamAddress, timeout_s: float, last: StreamError | None) -> NoPictureError:
    """The caller's time is up."""
    why = f" ({last.what})" if last else ""
    return NoPictureError(
        f"no picture from {address.uri} within {timeout_s:g} s{why}",
        "Check robotctl status: is the preview RUNNING, does it encode frames, is a passphrase needed",
    )
