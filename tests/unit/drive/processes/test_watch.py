"""How long the worker may be silent."""

from drive.motion.values import MS
from drive.processes.watch import DRIVING_NS, RESTING_NS, START_NS, Watch


def test_the_deadline_follows_who_has_the_robot() -> None:
    watch = Watch.started(0)
    assert not watch.silent(START_NS - 1)
    assert watch.silent(START_NS)
    watch.beat(0, leased=True)
    assert not watch.silent(DRIVING_NS - 1)
    assert watch.silent(DRIVING_NS)
    watch.beat(0, leased=False)
    assert not watch.silent(RESTING_NS - 1)
    assert watch.silent(RESTING_NS)


def test_a_guard_that_was_frozen_itself_gives_the_worker_one_more_period() -> None:
    watch = Watch.started(0)
    watch.beat(0, leased=True)
    late_ns = DRIVING_NS + 300 * MS
    assert not watch.silent(late_ns)
    assert watch.deadline_ns == late_ns + DRIVING_NS
    assert watch.silent(late_ns + 10 * DRIVING_NS), "once, not again and again"
    watch.beat(late_ns, leased=True)
    assert not watch.silent(late_ns + 10 * DRIVING_NS)
