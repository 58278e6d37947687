"""The offset to the robot's clock: the actual one is always within the bound."""

from hypothesis import given
from hypothesis import strategies as st

from console.client.clock import Clock
from console.client.results import RobotTime


def at(robot_s: float, boot_id: str = "boot") -> RobotTime:
    return RobotTime(monotonic_ns=round(robot_s * 1e9), wall_clock_unix_ns=0, boot_id=boot_id)


def test_before_the_first_answer_nothing_is_known() -> None:
    assert Clock().offset(1.0) is None
    assert Clock().local_s(5, 1.0) is None


def test_the_quickest_answer_counts() -> None:
    clock = Clock()
    clock.note(10.0, at(1010.9), 11.0)
    clock.note(20.0, at(1020.01), 20.02)
    clock.note(21.0, at(1021.4), 21.5)
    offset = clock.offset(21.5)
    assert offset is not None
    assert abs(offset.seconds - 1000.0) < 0.011
    assert 0.01 <= offset.error_s < 0.0105


def test_the_error_grows_until_a_fresh_answer_is_better() -> None:
    clock = Clock()
    clock.note(0.0, at(1000.0), 0.0002)
    soon, late = clock.offset(1.0), clock.offset(1000.0)
    assert soon is not None
    assert late is not None
    assert late.error_s > soon.error_s + 0.1
    clock.note(1000.0, at(2000.05), 1000.1)
    fresh = clock.offset(1000.1)
    assert fresh is not None
    assert fresh.error_s < 0.0501


def test_a_robot_that_was_started_anew_has_another_clock() -> None:
    clock = Clock()
    clock.note(10.0, at(5000.0), 10.0001)
    clock.note(60.0, at(3.0, boot_id="another"), 61.0)
    offset = clock.offset(61.0)
    assert offset is not None
    assert abs(offset.seconds - (3.0 - 60.5)) < 1e-6


def test_a_computer_that_was_suspended_has_another_offset_at_once() -> None:
    """Its clock stood still for a minute; the first answer afterwards is slow, and counts all the same."""
    clock = Clock()
    for second in range(10):
        clock.note(10.0 + second, at(1010.0 + second), 10.0001 + second)
    clock.note(20.0, at(1080.2), 20.4)
    offset = clock.offset(20.4)
    assert offset is not None
    assert abs(offset.seconds - 1060.0) < 0.001
    assert 0.2 <= offset.error_s < 0.201


def test_an_instant_of_the_robot_on_our_clock() -> None:
    clock = Clock()
    clock.note(10.0, at(1010.0), 10.0)
    assert clock.local_s(1_005_000_000_000, 10.0) == 5.0


CALLS = st.lists(
    st.tuples(st.floats(0.01, 30), st.floats(0, 2), st.floats(0, 2)),
    min_size=1,
    max_size=40,
)


@given(CALLS, st.floats(-1e5, 1e5), st.floats(-100e-6, 100e-6), st.floats(0, 60))
def test_the_true_offset_is_never_further_off_than_the_bound(
    calls: list[tuple[float, float, float]], offset_s: float, drift: float, later_s: float
) -> None:
    """Whatever the link does to requests and answers, and though the robot's clock runs otherwise."""
    clock, now_s = Clock(), 200_000.0

    def robot_s(local_s: float) -> float:
        return local_s + offset_s + drift * (local_s - 200_000.0)

    for pause_s, there_s, back_s in calls:
        now_s += pause_s
        sent_s = now_s
        reading = at(robot_s(sent_s + there_s))
        now_s += there_s + back_s
        clock.note(sent_s, reading, now_s)
    now_s += later_s
    estimate = clock.offset(now_s)
    assert estimate is not None
    assert abs(estimate.seconds - (robot_s(now_s) - now_s)) <= estimate.error_s + 1e-6
