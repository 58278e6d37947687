"""The failure table of gateway.links, for any service: here one without rules of its own."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from gateway.links.reconciler import Reconciler
from tests.support.lamp import LampModel, LampReport, LampSpec, LampView

FIRST = 1000
LampReconciler = Reconciler[LampSpec, LampReport, LampView]
DIM, BRIGHT = LampSpec(10), LampSpec(90)


def connected() -> LampReconciler:
    reconciler = Reconciler(FIRST, LampModel())
    assert reconciler.take_report(LampReport("a"), 0.0)
    return reconciler


def test_a_request_is_pending_until_it_is_applied_and_settled_when_reached() -> None:
    reconciler = connected()
    desired = reconciler.request(BRIGHT, "request-7")
    assert desired.request_id == "request-7"
    assert reconciler.pending() is desired
    reconciler.take_report(LampReport("a", desired.revision, percent=50), 1.0)
    assert reconciler.pending() is None
    assert not reconciler.settled(desired)
    reconciler.take_report(LampReport("a", desired.revision, percent=90), 2.0)
    assert reconciler.settled(desired)


def test_nothing_is_pending_while_the_service_is_unreachable() -> None:
    reconciler = Reconciler(FIRST, LampModel())
    desired = reconciler.request(BRIGHT)
    assert desired.revision > FIRST
    assert reconciler.pending() is None
    reconciler.take_report(LampReport("a"), 0.0)
    assert reconciler.pending() is desired
    reconciler.take_loss("gone")
    assert reconciler.pending() is None


def test_a_process_with_an_empty_memory_gets_the_desired_state_again() -> None:
    reconciler = connected()
    desired = reconciler.request(BRIGHT)
    reconciler.take_report(LampReport("a", desired.revision, 90), 1.0)
    reconciler.take_loss("gone")
    reconciler.take_report(LampReport("b"), 2.0)
    assert reconciler.pending() is desired


def test_a_refused_request_is_not_repeated_to_the_same_process_but_to_the_next() -> None:
    reconciler = connected()
    desired = reconciler.request(BRIGHT)
    reconciler.take_refusal(desired, "too bright")
    assert (reconciler.refusal, reconciler.pending()) == ("too bright", None)
    assert reconciler.settled(desired)
    reconciler.take_report(LampReport("b"), 1.0)
    assert (reconciler.refusal, reconciler.pending()) == (None, desired)


def test_a_new_request_follows_a_refused_one() -> None:
    reconciler = connected()
    reconciler.take_refusal(reconciler.request(BRIGHT), "too bright")
    desired = reconciler.request(DIM)
    assert reconciler.pending() is desired


def test_a_restarted_gateway_adopts_what_the_service_does() -> None:
    reconciler = Reconciler(FIRST, LampModel())
    reconciler.take_report(LampReport("a", 77, percent=40), 0.0)
    assert (reconciler.desired.revision, reconciler.desired.spec) == (77, LampSpec(40))
    assert reconciler.pending() is None
    assert reconciler.request(BRIGHT).revision == 78


def test_a_newer_revision_than_ours_makes_ours_newer_still() -> None:
    reconciler = connected()
    desired = reconciler.request(BRIGHT)
    reconciler.take_report(LampReport("a", desired.revision + 5, 40), 1.0)
    assert reconciler.pending() == replace(desired, revision=desired.revision + 6)


def test_a_report_that_a_reply_has_overtaken_is_ignored() -> None:
    reconciler = connected()
    desired = reconciler.request(BRIGHT)
    reconciler.take_report(LampReport("a", desired.revision, 90), 1.0)
    assert not reconciler.take_report(LampReport("a", 0, 0), 1.1)
    assert reconciler.view.percent == 90
    assert reconciler.pending() is None


def test_an_older_report_counts_after_a_loss() -> None:
    """The process may have lost what it had applied, without becoming another one."""
    reconciler = connected()
    desired = reconciler.request(BRIGHT)
    reconciler.take_report(LampReport("a", desired.revision, 90), 1.0)
    reconciler.take_loss("gone")
    assert reconciler.take_report(LampReport("a", 0, 0), 2.0)
    assert reconciler.pending() is desired


def test_only_a_spec_that_was_applied_before_is_applied_again() -> None:
    seen: list[bool] = []

    class Recording(LampModel):
        def take_report(self, _spec: LampSpec, _report: LampReport, *, reapplying: bool) -> None:
            seen.append(reapplying)

    reconciler = Reconciler(FIRST, Recording())
    first = reconciler.request(BRIGHT)
    reconciler.take_report(LampReport("a"), 0.0)
    reconciler.take_report(LampReport("a", first.revision), 1.0)
    reconciler.take_report(LampReport("b"), 2.0)
    reconciler.request(DIM)
    reconciler.take_report(LampReport("b"), 3.0)
    assert seen == [False, False, True, False]


def test_an_older_request_is_settled_by_a_newer_one() -> None:
    reconciler = connected()
    older, newer = reconciler.request(BRIGHT), reconciler.request(DIM)
    assert reconciler.settled(older)
    assert not reconciler.settled(newer)


def test_an_unreachable_service_settles_a_request_after_one_more_attempt() -> None:
    reconciler = Reconciler(FIRST, LampModel())
    reconciler.take_loss("gone")
    desired = reconciler.request(BRIGHT)
    assert not reconciler.settled(desired)
    reconciler.take_loss("gone")
    assert reconciler.settled(desired)


def test_only_the_first_loss_and_the_first_report_are_a_change_of_contact() -> None:
    reconciler = connected()
    assert not reconciler.take_report(LampReport("a"), 1.0)
    assert [reconciler.take_loss("gone"), reconciler.take_loss("gone")] == [True, False]
    assert reconciler.take_report(LampReport("a"), 2.0)


STEPS = st.one_of(
    st.tuples(st.just("request"), st.integers(0, 3)),
    st.tuples(st.sampled_from(["a", "b"]), st.integers(0, 3)),
    st.tuples(st.just("loss"), st.just(0)),
)


@given(steps=st.lists(STEPS, max_size=40))
def test_the_view_is_a_new_object_for_each_change_and_for_nothing_else(steps: list[tuple[str, int]]) -> None:
    reconciler = Reconciler(FIRST, LampModel())
    before = reconciler.view
    for step, percent in steps:
        if step == "request":
            reconciler.request(LampSpec(percent))
        elif step == "loss":
            reconciler.take_loss("gone")
        else:
            reconciler.take_report(LampReport(step, reconciler.desired.revision, percent), 0.0)
        assert (reconciler.view is before) == (reconciler.view == before)
        before = reconciler.view
