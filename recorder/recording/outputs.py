"""What is being written at present: the running recording, and the ring."""

from typing import Final, Protocol

from recorder.values import Losses
from recorder.writing.output import Output

_RATE_EVERY_S: Final = 2.0


class Sources(Protocol):
    """What takes messages and puts them into the queue."""

    @property
    def problem(self) -> str:
        """What keeps something wanted from being recorded, for people; empty if nothing does."""

    def want(self, presets: frozenset[str], *, video: bool) -> None:
        """Takes the topics of these presets, and the video, from now on; everything else no longer."""

    async def caught_up(self) -> None:
        """Returns when all that has come or was lost by now is in the queue, or after a bounded time."""


class Outputs:
    """The outputs that the writer has open, and their rate. The sources take their topics, and nothing else.

    Args:
        sources: of the messages.

    Attributes:
        bytes_per_s: as measured last.
    """

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._recording: Output | None = None
        self._ring: Output | None = None
        self.bytes_per_s = 0
        self._rate_from: tuple[float, int] = (0.0, 0)

    @property
    def recording(self) -> Output | None:
        """Of the running recording."""
        return self._recording

    @recording.setter
    def recording(self, output: Output | None) -> None:
        self._recording = output
        self._want()

    @property
    def ring(self) -> Output | None:
        """Of the ring."""
        return self._ring

    @ring.setter
    def ring(self, output: Output | None) -> None:
        self._ring = output
        self._want()

    @property
    def all(self) -> list[Output]:
        """Both, as far as there are any."""
        return [each for each in (self._recording, self._ring) if each]

    @property
    def losses(self) -> Losses:
        """What is missing, each by the output that lacks more of it."""
        found = [each.progress.losses for each in self.all]
        return Losses(
            max((each.messages for each in found), default=0),
            max((each.uncounted for each in found), default=0),
            all(each.numbered for each in found),
        )

    def measure(self, now_s: float) -> None:
        """Measures the rate, every 2 s.

        Args:
            now_s: monotonic seconds.
        """
        written = sum(each.progress.bytes for each in self.all)
        since_s, before = self._rate_from
        if written < before or now_s - since_s >= _RATE_EVERY_S:
            if written >= before and since_s:
                self.bytes_per_s = int((written - before) / (now_s - since_s))
            self._rate_from = (now_s, written)

    def _want(self) -> None:
        shapes = [each.shape for each in self.all]
        presets = frozenset(shape.preset for shape in shapes)
        self._sources.want(presets, video=any(shape.with_video for shape in shapes))
