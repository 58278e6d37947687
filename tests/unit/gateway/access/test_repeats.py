"""Repeated control actions: a few are recorded one by one, the rest by their number, and none is lost."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.access.audit import AuditLog
from gateway.access.repeats import BURST, MAX_CALLERS, MAX_KINDS, MAX_TIMES, WINDOW_S, Repeats
from gateway.config import AuditSettings
from gateway.status.event import ControlAction, ControlResult, Motion

TICK_S = 0.2


def action(request: str, who: str = "anna", port: int = 4, **others: str) -> ControlAction:
    return ControlAction(
        who=who,
        address=f"10.0.0.5:{port}",
        method="SetPreviewMode",
        request=request,
        result=ControlResult.ACCEPTED,
        answer=others.get("answer", "done"),
        role="operator",
        credential="a" * 12,
        request_id=others.get("request_id", ""),
    )


class Ground:
    """Repeats with a clock of its own, and what they recorded."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.records: list[ControlAction] = []
        self.repeats = Repeats(self.records.append, lambda: self.now_s)

    def take(self, each: ControlAction, times: int = 1, prefix: str = "10.0.0.5") -> None:
        for _ in range(times):
            self.repeats.take(each, prefix)

    def wait(self, seconds: float) -> None:
        self.now_s += seconds
        self.repeats.record_due()

    def recorded(self) -> list[tuple[str, int]]:
        """The records since the last look: request and count."""
        records = [(each.request, each.count) for each in self.records]
        self.records.clear()
        return records


SINGLY = [("on", 1)] * BURST


@pytest.mark.parametrize(
    ("steps", "records"),
    [
        pytest.param([("on", 3)], [("on", 1)] * 3, id="few"),
        pytest.param([("on", BURST + 5)], SINGLY, id="a burst"),
        pytest.param([("on", BURST + 5), WINDOW_S - 1], SINGLY, id="the window is still open"),
        pytest.param([("on", BURST + 5), WINDOW_S], [*SINGLY, ("on", 5)], id="the caller is silent"),
        pytest.param(
            [("on", BURST + 5), WINDOW_S, ("on", 7), WINDOW_S],
            [*SINGLY, ("on", 5), ("on", 7)],
            id="one fold a window",
        ),
        pytest.param(
            [("on", BURST + 5), ("off", 1), ("on", 1), ("off", 2), WINDOW_S],
            [*SINGLY, ("off", 1), ("on", 6), ("off", 2)],
            id="repeats of one thing do not hold back another",
        ),
        pytest.param(
            [("on", BURST + 5), WINDOW_S, WINDOW_S, ("on", 1)],
            [*SINGLY, ("on", 5), ("on", 1)],
            id="after a quiet window it is new",
        ),
        pytest.param(
            [("on", BURST + 5), WINDOW_S, *[WINDOW_S] * BURST, ("on", BURST + 1), WINDOW_S],
            [*SINGLY, ("on", 5), *SINGLY, ("on", 1)],
            id="a bucket that is full again",
        ),
        pytest.param([("on", BURST + 1), None], [*SINGLY, ("on", 1)], id="the program ends"),
        pytest.param([("on", BURST + 1), None, None], [*SINGLY, ("on", 1)], id="and has nothing left"),
    ],
)
def test_repeats_of_one_caller(
    steps: list[tuple[str, int] | float | None], records: list[tuple[str, int]]
) -> None:
    ground = Ground()
    for step in steps:
        match step:
            case (request, times):
                ground.take(action(request), times)
            case None:
                ground.repeats.record_all()
            case seconds:
                ground.wait(seconds)
    assert ground.recorded() == records


def test_a_fold_describes_the_newest_and_has_the_first_times() -> None:
    ground = Ground()
    ground.take(action("on"), BURST)
    ground.records.clear()
    for number in range(MAX_TIMES + 4):
        ground.take(replace(action("on", request_id=str(number)), unix_s=100.0 + number))
    ground.wait(WINDOW_S)
    [fold] = ground.records
    assert (fold.count, fold.request_id, fold.unix_s) == (MAX_TIMES + 4, str(MAX_TIMES + 3), 119.0)
    assert fold.earlier_unix_s == tuple(100.0 + number for number in range(MAX_TIMES))
    assert (fold.who, fold.address, fold.result) == ("anna", "10.0.0.5:4", ControlResult.ACCEPTED)


def motion(number: int) -> Motion:
    return Motion(duration_s=number / 10, distance_m=number / 100, turned_rad=0.0, device="keyboard")


def test_a_fold_of_motions_has_each_of_the_first_and_the_newest_and_the_sum_of_all() -> None:
    ground = Ground()
    ground.take(replace(action("", who="anna"), motion=motion(0)), BURST)
    assert [record.motions for record in ground.records] == [()] * BURST
    ground.records.clear()
    held = [motion(number) for number in range(1, MAX_TIMES + 5)]
    for each in held:
        ground.take(replace(action(str(each)), motion=each, unix_s=100.0 + each.duration_s))
    ground.wait(WINDOW_S)
    [fold] = ground.records
    assert fold.motions == (*held[:MAX_TIMES], held[-1])
    assert fold.earlier_unix_s == tuple(100.0 + each.duration_s for each in held[:MAX_TIMES])
    assert fold.request.startswith(f"{sum(each.duration_s for each in held):.1f} s, ")


def test_a_fold_of_two_motions_has_both() -> None:
    ground = Ground()
    ground.take(replace(action(""), motion=motion(0)), BURST)
    for number in (1, 2):
        ground.take(replace(action(""), motion=motion(number)))
    ground.wait(WINDOW_S)
    assert ground.records[-1].motions == (motion(1), motion(2))


def test_other_answers_addresses_and_credentials_are_no_repeats() -> None:
    ground = Ground()
    ground.take(action("on"), 100)
    ground.records.clear()
    ground.take(action("on", answer="nothing changed"))
    ground.take(action("on"), prefix="10.0.0.6")
    assert ground.recorded() == [("on", 1)] * 2
    ground.take(action("on", port=5))
    assert ground.recorded() == [], "another port is a repeat"


def test_a_fold_of_several_connections_says_so() -> None:
    ground = Ground()
    ground.take(action("on", port=4), BURST + 2)
    ground.take(action("on", port=5), 2)
    ground.wait(WINDOW_S)
    assert ground.records[-1].address == "10.0.0.5:5 and others"


@pytest.mark.parametrize("result", ControlResult)
def test_kinds_beyond_the_bound_share_a_fold_per_result(result: ControlResult) -> None:
    ground = Ground()
    for number in range(MAX_KINDS):
        ground.take(action(str(number)), BURST)
    ground.records.clear()
    for number in range(100):
        ground.take(replace(action(f"more {number}"), result=result))
    assert ground.recorded() == [("more 0", 1)]
    ground.wait(WINDOW_S)
    rest = [each for each in ground.records if each.request.startswith("more")]
    assert [(each.request, each.count, each.result) for each in rest] == [("more 99 and others", 99, result)]


def stranger(number: int) -> tuple[ControlAction, str]:
    prefix = f"10.1.{number // 256}.{number % 256}"
    return ControlAction(
        "", f"{prefix}:4", "SetPreviewMode", "", ControlResult.REFUSED, "no credential"
    ), prefix


def test_addresses_beyond_the_bound_share_one_bucket_and_reset_none() -> None:
    ground = Ground()
    first, first_prefix = stranger(0)
    ground.take(first, BURST + 1, first_prefix)
    for number in range(1, MAX_CALLERS):
        each, prefix = stranger(number)
        ground.take(each, BURST + 1, prefix)
    assert len(ground.records) == MAX_CALLERS * BURST
    ground.records.clear()

    for number in range(MAX_CALLERS, MAX_CALLERS + 1000):
        each, prefix = stranger(number)
        ground.take(each, 3, prefix)
    singly = BURST + MAX_KINDS + 1
    assert BURST <= len(ground.records) <= singly
    ground.records.clear()
    ground.take(first, 100, first_prefix)
    assert ground.records == [], "the table's overflow has refilled no bucket"

    ground.wait(WINDOW_S)
    counts = Counter({each.address: each.count for each in ground.records})
    assert len(ground.records) <= MAX_CALLERS + MAX_KINDS + 1
    assert counts[f"{first_prefix}:4"] == 101
    [others] = [each for each in ground.records if each.address.endswith("and others")]
    assert others.count > 2900
    assert (others.who, others.method, others.result) == ("", "SetPreviewMode", ControlResult.REFUSED)


def test_a_flood_of_addresses_hides_no_name() -> None:
    ground = Ground()
    for number in range(MAX_CALLERS * 2):
        each, prefix = stranger(number)
        ground.take(each, BURST + 1, prefix)
    ground.records.clear()
    for number in range(100):
        ground.take(action("on", who=f"operator-{number}"))
    assert [each.who for each in ground.records] == [f"operator-{number}" for number in range(100)]


def test_callers_are_forgotten_when_that_resets_nothing() -> None:
    ground = Ground()
    ground.take(action("on"), BURST + 5)
    for _ in range(BURST - 1):
        ground.wait(WINDOW_S)
        assert len(vars(ground.repeats)["_callers"]) == 1
    for _ in range(2):
        ground.wait(WINDOW_S)
    assert len(vars(ground.repeats)["_callers"]) == 0


def test_an_operator_who_flips_a_mode_100_times_a_second(tmp_path: Path) -> None:
    """The numbers of docs/security.md: two records a minute, and a day and more in the default files."""
    minutes = 5
    ground, settings = Ground(), AuditSettings()
    ticks = round(minutes * WINDOW_S / TICK_S)
    for _ in range(ticks):
        for _ in range(round(100 * TICK_S / 2)):
            ground.take(action("enabled: true", answer="preview is running, balanced"))
            ground.take(action("enabled: false", answer="preview is off"))
        ground.wait(TICK_S)
    assert sum(each.count for each in ground.records) >= 100 * (minutes - 1) * WINDOW_S
    assert len(ground.records) == BURST + 2 * minutes

    log = AuditLog(tmp_path / "a", 1 << 20, 2)
    with log.writing():
        for each in ground.records[BURST:]:
            log.record(each)
    bytes_per_hour = (tmp_path / "a").stat().st_size / minutes * 60
    assert settings.max_kib * 1024 * (settings.generations - 1) / bytes_per_hour > 24
    lines = [json.loads(line) for line in (tmp_path / "a").read_text().splitlines()]
    assert {line["request"] for line in lines} == {"enabled: true", "enabled: false"}
    assert {len(line["times"]) for line in lines} == {MAX_TIMES}


STEPS = st.lists(
    st.tuples(st.sampled_from("abc"), st.integers(0, MAX_KINDS + 3), st.floats(0, 2 * WINDOW_S)), max_size=150
)


@given(STEPS)
def test_none_is_lost_and_the_log_grows_slowly(steps: list[tuple[str, int, float]]) -> None:
    ground = Ground()
    began_s = ground.now_s
    for who, request, pause_s in steps:
        ground.wait(pause_s)
        ground.take(action(str(request), who=who))
    windows = (ground.now_s - began_s) / WINDOW_S
    for who in "abc":
        records = [each for each in ground.records if each.who == who]
        assert len(records) <= BURST + (MAX_KINDS + 2) * (windows + 1)
    ground.repeats.record_all()
    assert sum(each.count for each in ground.records) == len(steps)
