"""Whose fault it is when the start of a pipeline does not return in time."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar

import pytest

from common.gst import Gst, stop
from preview.encoders.catalogue import CATALOGUE
from preview.pipeline.events import Blame, HungError
from preview.pipeline.runner import Runner
from tests.support.eventually import eventually
from tests.support.pipeline_contract import LIVE, Events, another, plan_of

pytestmark = pytest.mark.gst


class Slow(Gst.Bin):  # type: ignore[misc]  # gi has no types
    """An element whose driver does not return from a change of state until it is released."""

    inner: ClassVar[str]
    blocks: ClassVar[Any]
    released: ClassVar[threading.Event]

    def __init__(self) -> None:
        super().__init__()
        body = Gst.parse_bin_from_description(self.inner, True)
        self.add(body)
        for name in ("sink", "src"):
            if pad := body.get_static_pad(name):
                self.add_pad(Gst.GhostPad.new(name, pad))

    def do_change_state(self, transition: Any) -> Any:
        if transition == Slow.blocks:
            Slow.released.wait(20)
        return Gst.Bin.do_change_state(self, transition)


class SlowCamera(Slow):
    inner = "videotestsrc is-live=true"


class SlowEncoder(Slow):
    inner = "videoconvert ! x264enc tune=zerolatency"


def register() -> None:
    for name, element in (("slowcamera", SlowCamera), ("slowencoder", SlowEncoder)):
        if Gst.ElementFactory.find(name) is None:
            element.set_metadata(name, "Video", "An element with a slow driver", "the tests")
            assert Gst.Element.register(None, name, Gst.Rank.NONE, element)


@pytest.fixture(params=[Gst.StateChange.NULL_TO_READY, Gst.StateChange.READY_TO_PAUSED])
def elements(request: pytest.FixtureRequest) -> Iterator[None]:
    """The slow elements exist, and block in one of the changes."""
    Slow.blocks, Slow.released = request.param, threading.Event()
    register()
    yield
    Slow.released.set()


@pytest.fixture
def slow_stop() -> Iterator[None]:
    """A camera exists that does not return from being stopped."""
    Slow.blocks, Slow.released = Gst.StateChange.PAUSED_TO_READY, threading.Event()
    register()
    yield
    Slow.released.set()


@pytest.mark.usefixtures("slow_stop")
async def test_a_camera_that_hangs_when_it_has_been_replaced_is_left_behind() -> None:
    """The stream goes on with the new one; only the end of the process frees the driver of the old one."""
    events = Events()
    plan = plan_of("slowcamera")
    short = plan.settings.timeouts.model_copy(update={"stop_s": 1.0})
    plan = replace(plan, settings=plan.settings.model_copy(update={"timeouts": short}))
    pipeline = Runner(plan, events)
    await pipeline.start()
    await events.wait_for("first_frame")
    for number, name in enumerate(("rear", "arm"), 1):
        pipeline.show(another(name))
        await events.wait_for("camera_shown", number)
    await events.wait_for("measured", events.counts["measured"] + 3)

    async def fps() -> float:
        assert pipeline.measurement is not None
        return pipeline.measurement.fps

    # Not in one window alone: a machine that stalls for a moment leaves it with few frames.
    await eventually(fps, lambda found: found > 20, "frames per second")
    assert not events.faults
    with pytest.raises(HungError, match=r"source.description hung when it was stopped"):
        await pipeline.stop()
    # What the end of the process does.
    Slow.released.set()
    stop(pipeline._running.parts.pipeline)
    pipeline._release()
    pipeline._framing.close()


@pytest.mark.parametrize(
    ("description", "encoder", "blame", "text"),
    [
        ("slowcamera", "x264enc", Blame.SOURCE, "source.description has not started within 2 s. Try it"),
        (LIVE, "slowencoder", Blame.ENCODER, "encoder x264 has not started within 2 s"),
    ],
)
@pytest.mark.usefixtures("elements")
async def test_the_one_that_blocks_is_blamed(description: str, encoder: str, blame: Blame, text: str) -> None:
    events = Events()
    plan = replace(plan_of(description, start_s=2.0), encoder=replace(CATALOGUE["x264"], element=encoder))
    pipeline = Runner(plan, events)
    await pipeline.start()
    (fault,) = events.faults
    assert fault.blame is blame
    assert fault.text.startswith(text)
    Slow.released.set()
    assert await (await pipeline.stop())
