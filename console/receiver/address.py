"""Address of an SRT stream."""

from dataclasses import dataclass, field

from common.errors import ExitCode, UserError

PASSPHRASE_LENGTHS = range(10, 80)
"""Lengths of a passphrase that SRT accepts (option SRTO_PASSPHRASE), in characters."""


@dataclass(frozen=True, slots=True)
class StreamAddress:
    """A stream as the robot's endpoint describes it.

    The codec is not part of it: the transport stream names its codec, also when that changes.

    Args:
        host: name or address of the robot.
        port: UDP port of its SRT listener.
        latency_ms: how long SRT waits for a lost packet; the larger value of both sides applies.
        passphrase: of this session; empty for an unencrypted stream. Left out of `repr`.
        capture_offset_ns: capture time minus PTS, both in ns; None when the robot does not report it.

    Raises:
        UserError: a value that SRT can't use.
    """

    host: str
    port: int = 7100
    latency_ms: int = 125
    passphrase: str = field(default="", repr=False)
    capture_offset_ns: int | None = None

    def __post_init__(self) -> None:
        if not self.host or any(sign in self.host for sign in " /?#@"):
            raise _invalid(f"stream host '{self.host}' is not a host name or an address")
        if self.port not in range(1, 65536):
            raise _invalid(f"stream port {self.port} is not between 1 and 65535")
        if self.latency_ms not in range(10_001):
            raise _invalid(f"stream latency {self.latency_ms} ms is not between 0 and 10000")
        if self.passphrase and len(self.passphrase) not in PASSPHRASE_LENGTHS:
            raise _invalid(
                f"stream passphrase has {len(self.passphrase)} characters, SRT takes "
                f"{PASSPHRASE_LENGTHS.start} to {PASSPHRASE_LENGTHS.stop - 1}"
            )

    @property
    def uri(self) -> str:
        """URI for any player, without the passphrase."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"srt://{host}:{self.port}"


def _invalid(reason: str) -> UserError:
    return UserError(reason, "Take the endpoint from: robotctl status", exit_code=ExitCode.USAGE)
