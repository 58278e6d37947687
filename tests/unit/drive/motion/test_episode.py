"""Times of motion, for the audit log."""

from dataclasses import replace

import pytest

from drive.motion.episode import followed
from drive.motion.machine import State
from drive.motion.phases import Phase
from drive.motion.values import Inhibit, Latch, Lease, Velocity

LEASE = Lease("s1", "anna")
ARMED = State(phase=Phase.ARMED, enabled=True, lease=LEASE)
MOVING = replace(ARMED, phase=Phase.DRIVING, output=Velocity(vx_mps=0.3, vy_mps=0.4, wz_rad_s=-1.0))


def test_distance_and_turn_add_up() -> None:
    episode = followed(None, ARMED, MOVING, 0)
    assert episode is not None
    assert (episode.episode_id, episode.holder, episode.ended_ns) == (1, "anna", 0)
    for second in (1, 2):
        before = replace(MOVING, output_ns=(second - 1) * 10**9)
        episode = followed(episode, before, MOVING, second * 10**9)
    assert episode is not None
    assert (episode.distance_m, episode.turned_rad) == pytest.approx((1.0, 2.0))
    ended = followed(episode, replace(MOVING, output_ns=2 * 10**9), ARMED, 2 * 10**9)
    assert ended is not None
    assert (ended.ended_ns, ended.ended_by) == (2 * 10**9, "released")
    assert followed(ended, ARMED, ARMED, 3 * 10**9) is ended
    again = followed(ended, ARMED, MOVING, 4 * 10**9)
    assert again is not None
    assert again.episode_id == 2


@pytest.mark.parametrize(
    ("after", "why"),
    [
        (replace(ARMED, phase=Phase.STOPPED, latch=Latch(1, "ben", "a child")), "stopped by ben: a child"),
        (replace(ARMED, phase=Phase.STOPPED, latch=Latch(1, "ben", "")), "stopped by ben"),
        (
            replace(ARMED, phase=Phase.INHIBITED, inhibits=frozenset({Inhibit.PICTURE_STALE})),
            "the driver's picture is too old",
        ),
        (replace(ARMED, phase=Phase.STOPPING, enabled=False, lease=None), "driving was disabled"),
        (replace(ARMED, phase=Phase.STOPPING, lease=None), "the session ended"),
        (replace(ARMED, phase=Phase.STOPPING, lease=Lease("s2", "carla")), "taken over by carla"),
    ],
)
def test_it_says_why_it_ended(after: State, why: str) -> None:
    episode = followed(followed(None, ARMED, MOVING, 0), MOVING, after, 10**9)
    assert episode is not None
    assert episode.ended_by == why
