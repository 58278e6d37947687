"""Where a stream is."""

from dataclasses import dataclass, field

from common.errors import ExitCode, UserError

PASSPHRASE_LENGTHS = range(10, 80)
"""What SRT accepts, in characters."""


@dataclass(frozen=True, slots=True)
class StreamAddress:
    """A stream as the robot's endpoint describes it.

    The codec is not part of it: the transport stream says what it carries, also when that changes.

    Args:
        host: name or address of the robot.
        port: UDP port of its SRT listener.
        latency_ms: how long SRT may wait for a lost packet. The larger one of both sides counts.
        passphrase: of this session; empty when the stream is not encrypted. Never shown.

    Raises:
        UserError: a value that SRT can't use.
    """

    host: str
    port: int = 7100
    latency_ms: int = 125
    passphrase: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        if not self.host or any(sign in self.host for sign in " /?#@"):
            raise _unusable(f"stream host '{self.host}' is not a host name or an address")
        if self.port not in range(1, 65536):
            raise _unusable(f"stream port {self.port} is not between 1 and 65535")
        if self.latency_ms not in range(10_001):
            raise _unusable(f"stream latency {self.latency_ms} ms is not between 0 and 10000")
        if self.passphrase and len(self.passphrase) not in PASSPHRASE_LENGTHS:
            raise _unusable(
                f"stream passphrase has {len(self.passphrase)} characters, SRT takes "
                f"{PASSPHRASE_LENGTHS.start} to {PASSPHRASE_LENGTHS.stop - 1}"
            )

    @property
    def uri(self) -> str:
        """What to type into a player, without the passphrase."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"srt://{host}:{self.port}"


def _unusable(what: str) -> UserError:
    return UserError(what, "Take the endpoint from: robotctl status", exit_code=ExitCode.USAGE)
