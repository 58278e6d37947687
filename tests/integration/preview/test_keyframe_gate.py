"""The gate when a viewer connects in the very moment in which a frame passes, on another thread."""

import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from common.gst import Gst
from preview.pipeline.keyframe_gate import KeyframeGate

pytestmark = pytest.mark.gst

LONG_ENOUGH_S = 0.2
Probe = Callable[[Any, Any], Any]


class Pad:
    """Keeps its probes; `add_probe` can be interrupted by what happens on another thread."""

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

    def __init__(self, *, key_frame: bool, meanwhile: Callable[[], None] | None = None) -> None:
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
        parts: Any = SimpleNamespace(parser_pad=self.pad, sink=self.sink)
        # Its calls on the loop, which request key frames, wait until the test has ended.
        self.gate = KeyframeGate(parts, lambda: None)

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
    passed = [ground.pad.push(Buffer(key_frame=False)) for _ in range(5)]
    assert passed == [False, False, False, True, True]


async def test_detached_no_probe_is_left() -> None:
    ground = Ground()
    ground.sink.connect_viewer()
    assert ground.pad.probes
    ground.gate.detach()
    assert not ground.pad.probes
