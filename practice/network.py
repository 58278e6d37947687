"""The network between the driver and the practice robot: how late what passes arrives. Pure."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Network:
    """How a network treats what passes.

    Attributes:
        title: for people.
        lesson: what a driver is to notice and to do, for people.
        each_way_s: delay of a message.
        picture_s: delay of a picture, from its capture to the screen's computer.
        gap_s: how long nothing passes, at the beginning of every `GAP_EVERY_S`; it passes afterwards.
        camera: whether the camera takes pictures.
        cut: nothing passes at all.
    """

    title: str
    lesson: str
    each_way_s: float = 0.005
    picture_s: float = 0.06
    gap_s: float = 0.0
    camera: bool = True
    cut: bool = False

    def arrives_s(self, sent_s: float) -> float | None:
        """Returns when a message of this instant, in s, arrives; None as long as nothing passes."""
        return None if self.cut else self._after_gap(sent_s) + self.each_way_s

    def picture_arrives_s(self, captured_s: float) -> float | None:
        """Returns when a picture of this instant arrives; None if it is lost."""
        return None if self.cut else self._after_gap(captured_s) + self.picture_s

    def _after_gap(self, sent_s: float) -> float:
        return sent_s + max(0.0, self.gap_s - sent_s % GAP_EVERY_S) if self.gap_s else sent_s


GAP_EVERY_S: Final = 3.0

NETWORKS: Final = (
    Network("good", "Press T to take the robot, hold W, release to stop. Space is STOP, Shift+R resets it."),
    Network(
        "old picture",
        "The picture is half a second old: the robot goes no farther than 10 cm within its age.",
        picture_s=0.45,
    ),
    Network(
        "silent camera",
        "The picture stands still: 0.6 s after it was taken the robot stops by itself.",
        camera=False,
    ),
    Network(
        "long delays",
        "Commands take too long to count. The robot stops; it moves only while they arrive in time.",
        each_way_s=0.15,
    ),
    Network(
        "gaps",
        "Every 3 s nothing passes for 0.4 s: the robot stops, and moves again only after a release.",
        gap_s=0.4,
    ),
    Network(
        "cut",
        "Nothing passes. The robot stops after 0.25 s; after 2 s it has lost its driver, and stays stopped.",
        cut=True,
    ),
)
"""The first is the one to begin with."""
