"""How long an operator sees nothing after the encoder of a running preview has failed.

From the last whole frame before to the first one after, as the console's viewer decodes it: it follows the
robot's status and redials by itself. A double of a hardware encoder encodes in software under the hardware's
name and then fails in one of the ways of a driver; x264 takes over. Where the process crashes, it is started
again as a container engine does it. 720p30, the preview service's default time-outs; its own test pattern,
because a hung encoder would keep the shared memory of the benchmarks' camera.
"""

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import foreign, product
from bench.video.viewing import PATIENCE_S
from bench.video.window import Glance, longest_gap_ms
from console.client import PreviewProfile
from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError
from console.receiver.frame import Frame, PixelFormat
from console.viewer.session import VideoSession
from tests.support.encoder_doubles import doubles
from tests.support.receiver import Receiver
from tests.support.running_preview import DOUBLES_DIR, ROOT
from tests.support.udp_link import UdpLink

ROUNDS: Final = FEWEST_ROUNDS
LATENCY_MS: Final = 125
PROMISED_MS: Final = 2000
AFTER_FRAMES: Final = 90
"""Of the encoder until it fails: the viewer has joined by then."""
LOSS: Final = 0.4
"""Of the link that turns bad."""
SETTLE_S: Final = 1.0
RESTART_DELAY_S: Final = 0.1
"""Docker's pause before it restarts a container the first time."""
_FOLLOW_EVERY_S: Final = 0.05
_ENCODER: Final = "mpp-h264"
_OTHER: Final = "x264"
_ELEMENT: Final = "mpph264enc"


@dataclass(frozen=True, slots=True)
class _Failure:
    """A way in which an encoder fails.

    Args:
        name: end of the row's name.
        what: what happens, for people.
        fault: the double's word for it (tests/support/encoder_doubles).
        trigger: what makes it fail, held until another encoder runs; None where it fails by itself.
    """

    name: str
    what: str
    fault: str
    trigger: Callable[[product.Robot], AbstractContextManager[None]] | None = None


@contextmanager
def _change_profile(robot: product.Robot) -> Iterator[None]:
    robot.client.enable_preview(PreviewProfile.LOW_BW)
    yield


@contextmanager
def _join(robot: product.Robot) -> Iterator[None]:
    # The request for its key frame is what fails; the stream of this encoder ends under the viewer.
    with robot.viewer() as viewer, suppress(StreamError):
        viewer.next_frame(PATIENCE_S)
    yield


@contextmanager
def _bad_link(robot: product.Robot) -> Iterator[None]:
    """Another viewer's link turns bad, and the bit rate is to follow it."""
    with UdpLink(robot.address.port) as link:
        far = StreamAddress(product.HOST, link.port, LATENCY_MS)
        with Receiver(far, queue_size=4, options=product.SRT_DELIVERY) as viewer:
            viewer.next_frame(PATIENCE_S)
            link.impairment.loss = LOSS
            yield


FAILURES: Final = (
    _Failure("error", "reports an error", f"error:{AFTER_FRAMES}"),
    _Failure("no_output", "swallows frames", f"no-output:{AFTER_FRAMES}"),
    _Failure("empty", "returns empty buffers", f"empty:{AFTER_FRAMES}"),
    _Failure("hang", "never returns a frame", f"hang:{AFTER_FRAMES}"),
    _Failure("crash", "crashes the process", f"crash:{AFTER_FRAMES}"),
    _Failure("profile_change", "never returns from a change of profile", "stuck:5", _change_profile),
    _Failure("key_frame", "never returns from a request for a key frame", f"deaf:{AFTER_FRAMES}", _join),
    _Failure("bit_rate", "never returns from a change of bit rate", f"stuck:{AFTER_FRAMES}", _bad_link),
)


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    return [
        Row(
            name=name,
            what=f"encoder {failure.what}: last frame before to first frame after, in the viewer",
            unit="ms",
            values=[_round(workdir, failure) for _ in range(ROUNDS)],
            bar=PROMISED_MS,
            judged="worst",
        )
        for failure in FAILURES
        if (name := f"video.dark_ms_{failure.name}") in wanted
    ]


def _round(workdir: Path, failure: _Failure) -> float:
    settings = {
        "encoders": {"order": [_ENCODER, _OTHER]},
        "timeouts": {},
    }
    environment = {
        "PYTHONPATH": f"{DOUBLES_DIR}:{ROOT}",
        doubles.VARIABLE: json.dumps({_ELEMENT: f"later {failure.fault}"}),
    }
    with (
        product.robot(
            workdir, None, LATENCY_MS, settings=settings, environment=environment, warm=False
        ) as robot,
        _restarted(robot.service),
        robot.preview(),
        closing(_Viewer(robot)) as viewer,
    ):
        if failure.trigger:
            viewer.wait_for(lambda: len(viewer.seen) > AFTER_FRAMES, f"{failure.name}: frames before")
        with failure.trigger(robot) if failure.trigger else nullcontext():
            viewer.wait_for(viewer.has_other_encoder, f"{failure.name}: another encoder")
        frames = len(viewer.seen)
        viewer.wait_for(lambda: len(viewer.seen) > frames + 10, f"{failure.name}: frames afterwards")
        glances = list(viewer.seen)
    dark_ms = longest_gap_ms(glances, glances[0].decoded_s + SETTLE_S, glances[-1].decoded_s)
    log(f"encoder {failure.what}: {dark_ms:.0f} ms dark")
    return dark_ms


class _Viewer:
    """The console's session, which follows the robot's status as every viewer does."""

    def __init__(self, robot: product.Robot) -> None:
        self.seen: list[Glance] = []
        self._client = robot.client
        self._preview = robot.client.status().preview
        self._session = VideoSession(pixels=PixelFormat.I420)
        self._session.add_frame_listener(self._note)
        self._session.start()

    def has_other_encoder(self) -> bool:
        """Whether the newest status names the encoder that takes over."""
        encoder = self._preview.encoder
        return encoder is not None and encoder.name == _OTHER

    def wait_for(self, holds: Callable[[], bool], what: str) -> None:
        """Follows the status until a condition holds."""
        deadline_s = time.monotonic() + PATIENCE_S
        while not holds():
            if time.monotonic() > deadline_s:
                raise RuntimeError(f"not within {PATIENCE_S:g} s: {what}; {self._preview}")
            self._preview = self._client.status().preview
            self._session.follow(self._preview)
            time.sleep(_FOLLOW_EVERY_S)

    def close(self) -> None:
        """Disconnects."""
        self._session.close()

    def _note(self, frame: Frame) -> None:
        self.seen.append(Glance(frame.arrival_s, frame.arrival_s, frame.corrupt))


@contextmanager
def _restarted(service: product.Service) -> Iterator[None]:
    """Restarts the service whenever it ends, until the block does."""
    ending = threading.Event()

    def run() -> None:
        while True:
            service.process.wait()
            if ending.wait(RESTART_DELAY_S):
                return
            service.start_again()

    engine = threading.Thread(target=run, name="container engine")
    engine.start()
    try:
        yield
    finally:
        ending.set()
        foreign.end(service.process)
        engine.join()
