"""Silence, with made-up clocks."""

from preview.config import TimeoutSettings
from preview.pipeline.events import Blame
from preview.pipeline.watchdogs import Watchdogs


def dogs() -> Watchdogs:
    return Watchdogs(0.0, TimeoutSettings(start_s=5.0, source_silence_s=1.5, encoder_silence_s=1.0))


def test_a_lively_pipeline_is_left_alone() -> None:
    watchdogs = dogs()
    for step in range(1, 200):
        assert watchdogs.check(step, step, step * 0.1) is None


def test_a_source_may_take_its_time_to_begin() -> None:
    watchdogs = dogs()
    assert watchdogs.check(0, 0, 4.9) is None
    assert watchdogs.check(0, 0, 5.1) == (Blame.SOURCE, "has sent no frame for 5.1 s")


def test_a_source_that_stalls() -> None:
    watchdogs = dogs()
    assert watchdogs.check(30, 30, 1.0) is None
    assert watchdogs.check(30, 30, 2.5) is None
    assert watchdogs.check(30, 30, 2.6) == (Blame.SOURCE, "has sent no frame for 1.6 s")


def test_a_camera_that_is_slow_by_nature_has_a_limit_of_its_own() -> None:
    watchdogs = dogs()
    assert watchdogs.check(1, 1, 1.0, 5.0) is None
    assert watchdogs.check(1, 1, 5.9, 5.0) is None
    assert watchdogs.check(1, 1, 6.1, 5.0) == (Blame.SOURCE, "has sent no frame for 5.1 s")


def test_an_encoder_that_never_begins_is_timed_from_the_first_frame() -> None:
    watchdogs = dogs()
    assert watchdogs.check(1, 0, 4.0) is None
    assert watchdogs.check(20, 0, 4.9) is None
    assert watchdogs.check(25, 0, 5.0) is None, "not longer than its second"
    assert watchdogs.check(26, 0, 5.5) == (Blame.ENCODER, "has produced no frame for 1.5 s")


def test_the_encoders_time_starts_with_an_early_first_frame() -> None:
    watchdogs = dogs()
    assert watchdogs.check(1, 0, 0.5) is None
    assert watchdogs.check(10, 0, 1.4) is None
    assert watchdogs.check(11, 0, 1.6) == (Blame.ENCODER, "has produced no frame for 1.1 s")


def test_an_encoder_that_stops() -> None:
    watchdogs = dogs()
    frames = 0
    for step in range(1, 11):
        frames += 3
        assert watchdogs.check(frames, frames, step * 0.1) is None
    for step in range(11, 20):
        frames += 3
        assert watchdogs.check(frames, 30, step * 0.1) is None
    assert watchdogs.check(frames + 3, 30, 2.05) == (Blame.ENCODER, "has produced no frame for 1.0 s")


def test_an_encoder_is_not_blamed_for_a_pause_of_the_source() -> None:
    watchdogs = dogs()
    assert watchdogs.check(30, 30, 1.0) is None
    assert watchdogs.check(30, 30, 2.3) is None
    # The source goes on; the encoder gets its own second from here.
    assert watchdogs.check(31, 30, 2.4) is None
    assert watchdogs.check(33, 30, 3.3) is None
    assert watchdogs.check(35, 30, 3.5) == (Blame.ENCODER, "has produced no frame for 1.1 s")
