"""Watches a robot over a link with the product's own viewer, in a process of its own.

Whether a frame is torn is judged by its pixels: it is, unless a decoder gives the same ones for the stream as
the robot sent it, taken down before the link loses anything of it.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from bench.rows import Row
from bench.video import product
from bench.video.camera import Camera
from bench.video.window import Glance, Glass, Window, longest_gap_ms
from console.client import PreviewProfile
from console.receiver.delivery import DeliveryChoice
from tests.support.sent_stream import SentStream
from tests.support.udp_link import Impairment, UdpLink

START_S: Final = 1.5
"""Until the viewer's program has started."""
_AFTERWARDS_S: Final = 1.0
_ENDS_WITHIN_S: Final = 30.0


@dataclass(frozen=True, slots=True)
class FarWatch:
    """What a viewer saw over a link.

    Args:
        glances: every frame with a stamp that it showed, from its start on; the torn ones are corrupt.
        torn: how many it showed that are torn, with or without a stamp.
        from_s: begin of the window, on `time.monotonic()`.
        until_s: its end.
        captured: frames that the camera took in it.
        passed_kbit: what passed the link in it, repeated packets included.
        redials: how often the viewer connected again because the stream had ended.
        delivery: its figures at the end, as in `robotctl view --json`.
        target_kbps: what the encoder was set to at the end.
        bitrate_reason: why that is not the profile's.
    """

    glances: Sequence[Glance]
    torn: int
    from_s: float
    until_s: float
    captured: int
    passed_kbit: float
    redials: int
    delivery: dict[str, Any]
    target_kbps: int
    bitrate_reason: str

    @property
    def window(self) -> Window:
        """The window's whole frames."""
        return Window.of(self.glances, self.from_s, self.until_s)

    @property
    def delivered_percent(self) -> float:
        """Share of the camera's frames in the window that were shown whole."""
        return self.window.delivered_percent(self.captured)

    @property
    def freeze_ms(self) -> float:
        """Longest time without a new whole frame in the window."""
        return longest_gap_ms(self.glances, self.from_s, self.until_s)

    def glass(self, after_s: float = 0.0) -> Glass:
        """Returns the picture that the viewer looked at.

        Args:
            after_s: so long after the first one it begins, unless the window ends before.
        """
        from_s = self.first_s + after_s
        return Glass(self.glances, from_s if from_s < self.until_s else self.first_s, self.until_s)

    @property
    def first_s(self) -> float:
        """When the first frame was decoded; the begin of the window where none came before its end."""
        decoded_s = (one.decoded_s for one in self.glances if one.decoded_s < self.until_s)
        return min(decoded_s, default=self.from_s)


def watch_far(
    source: Camera,
    robot: product.Robot,
    impairment: Impairment,
    *,
    settle_s: float,
    watch_s: float,
    profile: PreviewProfile = PreviewProfile.BALANCED,
    delivery: DeliveryChoice = DeliveryChoice.AUTO,
    seed: int = 1,
    while_watching: Callable[[UdpLink], None] | None = None,
) -> FarWatch:
    """Watches a robot that was made with `far`, its preview disabled.

    Args:
        source: its camera.
        robot: the product.
        impairment: of the link.
        settle_s: time before the window.
        watch_s: length of the window.
        profile: of the preview.
        delivery: of the viewer.
        seed: of the losses.
        while_watching: changes the link in the window; must return before its end.
    """
    total_s = START_S + settle_s + watch_s + _AFTERWARDS_S
    command = [sys.executable, "-m", "bench.video.far_viewer", robot.client.target, str(total_s)]
    command += ["--delivery", delivery.value]
    sent = SentStream()
    with (
        robot.preview(profile),
        robot.link(impairment, seed, sent.take) as link,
        subprocess.Popen(command, stdout=subprocess.PIPE) as viewer,
    ):
        time.sleep(START_S + settle_s)
        from_s, before = time.monotonic(), link.bytes_to_callers
        if while_watching:
            while_watching(link)
        time.sleep(max(0.0, from_s + watch_s - time.monotonic()))
        until_s, passed = time.monotonic(), link.bytes_to_callers - before
        preview = robot.client.status().preview
        written, _ = viewer.communicate(timeout=total_s + _ENDS_WITHIN_S)
    found = json.loads(written)
    whole = sent.pictures()
    return FarWatch(
        [
            Glance(captured_s, decoded_s, corrupt=shown not in whole)
            for captured_s, decoded_s, shown in found["frames"]
            if captured_s is not None
        ],
        whole.torn(shown for _, _, shown in found["frames"]),
        from_s,
        until_s,
        source.captured(from_s, until_s),
        passed * 8 / 1000,
        found["redials"],
        found["delivery"],
        preview.target_bitrate_kbps,
        preview.bitrate_reason,
    )


def torn_row(name: str, what: str, found: Sequence[FarWatch]) -> Row:
    """Returns the row of torn frames, of which none may be shown."""
    torn = [each.torn for each in found]
    return Row(
        name=name, what=f"{what}: torn frames that were shown", unit="", values=torn, bar=0, judged="worst"
    )
