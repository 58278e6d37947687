"""Which stream to call, and when to call again. Pure: no thread, no clock of its own."""

from typing import Final

from console.client.results import PreviewState, PreviewStatus, StreamContainer, StreamTransport
from console.receiver.address import StreamAddress

FIRST_WAIT_S: Final = 0.1
LONGEST_WAIT_S: Final = 0.5
"""Short, because a call itself lasts up to 3 s, and a listener that comes back in that time answers it."""
_BLOCKED_WAIT_S: Final = 5.0
"""What calling again can't mend may still be mended by the robot's keeper."""
_GROWTH: Final = 2.0


def address_of(preview: PreviewStatus) -> StreamAddress | None:
    """The stream to call; None while nobody wants a preview or none is known.

    A preview that is faulted is called as well: it tries again by itself, and its listener may be there
    before the gateway has said so.

    Raises:
        UserError: the robot tells an address that can't be used.
    """
    endpoint = preview.endpoint
    if endpoint is None or preview.state in (PreviewState.DISABLED, PreviewState.STOPPING):
        return None
    if endpoint.transport is not StreamTransport.SRT or endpoint.container is not StreamContainer.MPEG_TS:
        return None
    return StreamAddress(endpoint.host, endpoint.port, endpoint.latency_ms, endpoint.passphrase)


class Patience:
    """How long one call may go without a picture.

    SRT itself takes 3.5 to 5 s to notice that the other side died without a word.

    Args:
        silent_s: after a picture, until the call counts as lost.
        first_s: until the first picture; longer than SRT needs to give up a call nobody answers.
    """

    def __init__(self, silent_s: float = 1.0, first_s: float = 4.0) -> None:
        self._silent_s = silent_s
        self._first_s = first_s

    def ends_s(self, called_s: float, picture_s: float | None) -> float:
        """When the call counts as lost, for when it began and its newest picture came."""
        return called_s + self._first_s if picture_s is None else picture_s + self._silent_s


class Pauses:
    """The pauses between calls: each twice the one before, up to a limit, until a picture comes."""

    def __init__(self) -> None:
        self._next_s = FIRST_WAIT_S

    def next_s(self, *, blocked: bool = False) -> float:
        """How long to wait before the next call."""
        if blocked:
            return _BLOCKED_WAIT_S
        pause_s, self._next_s = self._next_s, min(self._next_s * _GROWTH, LONGEST_WAIT_S)
        return pause_s

    def reset(self) -> None:
        """There is reason for hope: a picture came, or the robot says that its preview runs."""
        self._next_s = FIRST_WAIT_S
