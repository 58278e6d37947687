"""Which camera is to be live: every row of the table, the pauses, and what operators see."""

import pytest

from preview.state import cameras
from preview.state.cameras import LONGEST_RETRY_S, STEADY_AFTER_S, Camera, Cameras, CameraState

ROBOT = {"front": "rear", "rear": "front", "arm": None, "mast": "arm"}


def robot(wanted: str, *failed: str) -> Cameras:
    """At time 0; those that failed wait until 1."""
    made = Cameras(ROBOT)
    made.want(wanted)
    for name in failed:
        made.failed(name, f"{name} is broken", 0.0)
    return made


@pytest.mark.parametrize(
    ("live", "wanted", "failed", "attempt"),
    [
        # A row of the table each, in its order.
        ("front", "front", (), None),
        (None, "front", (), "front"),
        (None, "front", ("front",), "rear"),
        ("rear", "front", ("front",), None),
        ("arm", "mast", ("mast",), None),
        ("front", "mast", ("mast",), "arm"),
        ("front", "arm", ("arm",), None),
        # And with all of them failed.
        (None, "front", ("front", "rear"), None),
        ("front", "rear", (), "rear"),
    ],
)
def test_the_next_attempt(
    live: str | None, wanted: str, failed: tuple[str, ...], attempt: str | None
) -> None:
    assert robot(wanted, *failed).next_attempt(live, 0.5) == attempt


def test_the_table_of_the_module_has_as_many_rows_as_are_tested() -> None:
    assert str(cameras.__doc__).count("\n| ") == 1 + 6


def test_the_first_camera_is_wanted_until_another_one_is() -> None:
    made = Cameras(ROBOT)
    assert (made.wanted, made.names) == ("front", ("front", "rear", "arm", "mast"))
    made.want("mast")
    made.want("")
    assert (made.wanted, made.chain) == ("mast", ("mast", "arm"))


def test_a_circle_of_fallbacks_is_gone_round_once() -> None:
    assert robot("rear").chain == ("rear", "front")


def test_a_failed_camera_is_tried_again_beside_its_fallback() -> None:
    made = robot("front", "front")
    assert made.next_attempt("rear", 0.9) is None
    assert made.wait_s("rear", 0.4) == pytest.approx(0.6)
    assert made.next_attempt("rear", 1.0) == "front"
    assert made.wait_s("front", 1.0) is None


def test_the_pauses_grow_and_start_again_after_a_steady_time() -> None:
    made, now, pauses = robot("front"), 100.0, list[float | None]()
    for _ in range(7):
        made.failed("front", "broken", now)
        pauses.append(made.wait_s("rear", now))
    assert pauses == [1, 2, 4, 8, 16, LONGEST_RETRY_S, LONGEST_RETRY_S]
    made.delivers("front", now)
    made.failed("front", "broken at once", now + 1)
    assert made.wait_s("rear", now + 1) == LONGEST_RETRY_S
    made.delivers("front", now)
    made.failed("front", "broken again", now + STEADY_AFTER_S)
    assert made.wait_s("rear", now + STEADY_AFTER_S) == 1


def test_a_request_has_the_wanted_camera_tried_at_once() -> None:
    made = robot("front", "front")
    made.want("")
    assert made.next_attempt("rear", 0.0) == "front"


def test_a_camera_that_is_there_again_is_tried_at_once() -> None:
    made = robot("front", "front")
    made.found({"front": "no such device", "rear": ""})
    assert made.next_attempt("rear", 0.5) is None
    made.found({"front": ""})
    assert made.next_attempt("rear", 0.5) == "front"
    assert made.listed("rear", None)[0] == Camera("front", CameraState.READY, "", "rear")


def test_one_that_is_missing_without_having_failed_is_tried_when_wanted() -> None:
    """What is missing is only a glance from outside: the attempt itself decides."""
    made = Cameras(ROBOT)
    made.found({"front": "no such device"})
    assert made.next_attempt(None, 0.0) == "front"


def test_what_is_listed() -> None:
    made = robot("mast", "rear")
    made.found({"arm": "no such device", "rear": ""})
    assert made.listed("front", "mast") == (
        Camera("front", CameraState.LIVE, fallback="rear"),
        Camera("rear", CameraState.FAILED, "rear is broken", "front"),
        Camera("arm", CameraState.FAILED, "no such device"),
        Camera("mast", CameraState.STARTING, fallback="arm"),
    )
    made.delivers("rear", 2.0)
    assert made.listed("rear", None)[1].state is CameraState.LIVE
    assert made.listed("front", None)[1] == Camera("rear", CameraState.READY, "", "front")
