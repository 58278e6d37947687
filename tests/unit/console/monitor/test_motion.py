"""Speed and turn rate, as the gauges show them."""

from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import MonitorState
from console.monitor.motion import motion
from omniseer.gateway.v1 import overlay_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.snapshots import NOW_S, heard, snapshot


def driving(speed_mps: float, *, limit_mps: float = 0.0) -> MonitorState:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.health.linear_speed_mps = speed_mps
        if limit_mps:
            made.status.teleop.state = states.TELEOP_ENABLED
            made.status.teleop.max_linear_mps = limit_mps

    return heard(snapshot(change))


def test_values_and_directions() -> None:
    found = motion(heard(), NOW_S)
    assert found
    assert (found.speed.value, round(found.turn.value, 3), found.stale) == (0.5, 0.3, False)


def test_the_scale_ends_at_the_robots_limit() -> None:
    found = motion(driving(0.5, limit_mps=0.8), NOW_S)
    assert found
    assert found.speed.top == 0.8


def test_without_a_limit_the_scale_grows_and_never_shrinks() -> None:
    slow, fast = motion(driving(0.3), NOW_S), motion(driving(1.7), NOW_S)
    assert slow
    assert fast
    assert (slow.speed.top, fast.speed.top) == (0.5, 3.0)
    again = motion(driving(0.3), NOW_S, fast)
    assert again
    assert again.speed.top == 3.0


def test_a_silent_robots_speed_is_stale() -> None:
    found = motion(heard(), NOW_S + 60)
    assert found
    assert found.stale


def test_a_robot_without_odometry_has_no_gauges() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.health.odom_available = False

    assert motion(heard(snapshot(change)), NOW_S) is None
    assert motion(MonitorState(Link(state=LinkState.CONNECTING, since_s=0)), NOW_S) is None
