"""The gate when a viewer connects in the very moment in which a frame passes, on another thread."""

import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from common.gst import Gst
from preview.pipeline.keyframe_gate import KeyframeGate
from tests.support.eventually import eventually
from tests.support.undisturbed import no_stall, undisturbed_async

pytestmark = pytest.mark.gst

LONG_ENOUGH_S = 0.2
Probe = Callable[[Any, Any], Any]


class Pad:
    """Keeps its probes; `add_probe` can be interrupted by what happens on another thread.

    Running times on it are the timestamps of its buffers.
    """

    def __init__(self) -> None:
        self.probes: dict[int, Probe] = {}
        self.meanwhile: Callable[[], None] | None = None
        self.added = 0

    def add_probe(self, _kind: Any, probe: Probe) -> int:
        self.added += 1
        number = self.added
        self.probes[number] = probe
        if self.meanwhile:
            self.meanwhile()
        return number

    def remove_probe(self, number: int) -> None:
        del self.probes[number]

    def get_sticky_event(self, _kind: Any, _index: int) -> Any:
        segment = Gst.Segment()
        segment.init(Gst.Format.TIME)
        return SimpleNamespace(parse_segment=lambda: segment)

    def push(self, buffer: "Buffer") -> bool:
        """Passes a frame through the probes; False when one of them dropped it."""
        results = {
            number: probe(self, SimpleNamespace(get_buffer=lambda: buffer))
            for number, probe in list(self.probes.items())
        }
        for number, result in results.items():
            if result == Gst.PadProbeReturn.REMOVE:
                del self.probes[number]
        return Gst.PadProbeReturn.DROP not in results.values()


class Buffer:
    """A frame; `meanwhile` happens while its flags are read."""

    def __init__(
        self, *, key_frame: bool, captured_s: float = 1.0, meanwhile: Callable[[], None] | None = None
    ) -> None:
        self.pts = round(captured_s * Gst.SECOND)
        self._key_frame = key_frame
        self._meanwhile = meanwhile

    def has_flags(self, _flags: Any) -> bool:
        if self._meanwhile:
            self._meanwhile()
        return not self._key_frame


class Sink:
    """A listener whose viewers the test connects."""

    def __init__(self) -> None:
        self.connect_viewer: Callable[[], None] = lambda: None

    def connect(self, _signal: str, handler: Callable[[], None]) -> int:
        self.connect_viewer = handler
        return 1

    def disconnect(self, _number: int) -> None: ...


class Ground:
    """A gate, and threads that come from elsewhere."""

    def __init__(self) -> None:
        self.pad, self.sink = Pad(), Sink()
        self._threads: list[threading.Thread] = []
        parts: Any = SimpleNamespace(parser_pad=self.pad)
        self.requested = 0
        self.calls: list[str] = []
        # Its calls on the loop, which request key frames for new viewers, wait until the test awaits.
        self.gate = KeyframeGate(parts, self._request, self._take_viewer)
        self.gate.watch(self.sink)

    def _request(self) -> None:
        self.requested += 1
        self.calls.append("key frame")

    def _take_viewer(self) -> None:
        self.calls.append("viewer")

    def elsewhere(self, call: Callable[[], object]) -> Callable[[], None]:
        """Returns a function that makes the call on another thread, and waits for it for a moment."""

        def begin() -> None:
            thread = threading.Thread(target=call)
            self._threads.append(thread)
            thread.start()
            thread.join(LONG_ENOUGH_S)

        return begin

    def settle(self) -> None:
        for thread in self._threads:
            thread.join(10)


async def test_a_key_frame_that_passes_while_the_gate_closes_does_not_keep_it_open() -> None:
    ground = Ground()
    ground.pad.meanwhile = ground.elsewhere(lambda: ground.pad.push(Buffer(key_frame=True)))
    ground.sink.connect_viewer()
    ground.settle()
    assert not ground.pad.probes
    ground.pad.meanwhile = None
    ground.sink.connect_viewer()
    assert not ground.pad.push(Buffer(key_frame=False)), "the next viewer gets no frame before its key frame"


async def test_a_viewer_that_connects_while_a_key_frame_opens_the_gate_closes_it_again() -> None:
    ground = Ground()
    ground.sink.connect_viewer()
    ground.pad.push(Buffer(key_frame=True, meanwhile=ground.elsewhere(ground.sink.connect_viewer)))
    ground.settle()
    assert not ground.pad.push(Buffer(key_frame=False))
    assert ground.pad.push(Buffer(key_frame=True))


async def test_after_its_limit_the_gate_opens_without_a_key_frame() -> None:
    ground = Ground()
    ground.sink.connect_viewer()
    passed = [ground.pad.push(Buffer(key_frame=False)) for _ in range(8)]
    assert passed == [False] * 6 + [True] * 2


async def test_a_viewer_is_announced_before_its_key_frame_is_requested() -> None:
    ground = Ground()
    ground.sink.connect_viewer()

    async def calls() -> list[str]:
        return ground.calls

    assert await eventually(calls, lambda made: len(made) == 2, "both calls") == ["viewer", "key frame"]


async def test_detached_no_probe_is_left() -> None:
    ground = Ground()
    ground.sink.connect_viewer()
    assert ground.pad.probes
    ground.gate.detach()
    assert not ground.pad.probes


def pts(captured_s: float) -> int:
    """As mpegtsmux writes it, an hour ahead."""
    return round((captured_s + 3600) * 90_000) % (1 << 33)


def lose(ground: Ground, newest_captured_s: float | None = None) -> bool:
    """A viewer has lost a picture; the newest of which it got anything was captured at this time."""
    return ground.gate.request_after_loss(None if newest_captured_s is None else pts(newest_captured_s))


async def test_a_lost_picture_gets_a_key_frame_at_once_and_nothing_is_dropped() -> None:
    ground = Ground()
    assert lose(ground, 1.0)
    assert ground.requested == 1
    assert [ground.pad.push(Buffer(key_frame=key)) for key in (False, False, True, False)] == [True] * 4
    assert not ground.pad.probes


async def test_a_key_frame_that_is_awaited_serves_all_losses() -> None:
    ground = Ground()
    assert lose(ground, 1.0)
    assert not lose(ground, 1.2)
    assert not lose(ground)
    assert ground.requested == 1


async def test_a_key_frame_made_after_the_loss_serves_it() -> None:
    ground = Ground()
    lose(ground, 1.0)
    ground.pad.push(Buffer(key_frame=True, captured_s=2.0))
    assert not lose(ground, 1.5), "it is on its way"
    assert lose(ground, 2.0), "the key frame itself is torn"
    ground.pad.push(Buffer(key_frame=True, captured_s=3.0))
    assert lose(ground, 3.5), "it is older than the loss"
    assert ground.requested == 3


@pytest.mark.parametrize("from_wrap_s", [-0.5, 0.0, 0.5])
async def test_which_is_later_is_known_over_the_wrap_of_pts(from_wrap_s: float) -> None:
    ground, at_s = Ground(), (1 << 33) / 90_000 - 3600 + from_wrap_s
    lose(ground, at_s - 0.2)
    ground.pad.push(Buffer(key_frame=True, captured_s=at_s))
    assert not lose(ground, at_s - 0.1)
    assert lose(ground, at_s + 0.1)


async def test_a_loss_that_a_key_frame_does_not_follow_in_time_may_be_reported_again() -> None:
    ground = Ground()
    lose(ground)
    for _ in range(11):
        assert ground.pad.push(Buffer(key_frame=False))
    assert not ground.pad.probes, "an encoder that ignores a request costs no time per frame"
    assert lose(ground)


async def test_losses_beyond_the_burst_wait_for_their_turn_and_share_it() -> None:
    async def attempt() -> None:
        # After 200 ms the next turn has come already.
        with no_stall():
            await losses_wait_for_their_turn_and_share_it()

    await undisturbed_async(attempt)


async def losses_wait_for_their_turn_and_share_it() -> None:
    ground = Ground()
    for captured_s in (1.0, 2.0, 3.0):
        assert lose(ground, captured_s)
        ground.pad.push(Buffer(key_frame=True, captured_s=captured_s + 0.1))
    assert ground.requested == 3
    assert lose(ground, 4.0)
    assert not lose(ground, 4.0)
    assert ground.requested == 3

    async def requested() -> int:
        return ground.requested

    assert await eventually(requested, lambda count: count > 3, "the fourth's turn") == 4
    ground.gate.detach()


async def test_a_new_viewers_key_frame_serves_a_loss_and_not_the_other_way_round() -> None:
    ground = Ground()
    ground.sink.connect_viewer()
    assert not lose(ground, 0.5)
    ground.pad.push(Buffer(key_frame=True))
    lose(ground, 2.0)
    ground.pad.push(Buffer(key_frame=True, captured_s=2.1))
    ground.sink.connect_viewer()
    assert not ground.pad.push(Buffer(key_frame=False)), "the viewer gets no frame before its key frame"


async def test_nothing_is_left_waiting_when_it_is_detached() -> None:
    ground = Ground()
    lose(ground)
    ground.gate.detach()
    assert not ground.pad.probes
