"""The failure table of gateway.preview_link, line by line, and a random walk against its invariants."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from gateway.preview_link.actual import Actual
from gateway.preview_link.reconciler import Reconciler
from gateway.preview_link.wish import Wish
from gateway.status.preview import Counters, Listener, PreviewState, Profile, Stream
from gateway.status.preview import PreviewState as S

FIRST = 1000
STREAM = Stream(1280, 720, 30.0, 2500, None, False, "")


def told(
    state: PreviewState = S.DISABLED,
    revision: int = 0,
    *,
    instance: str = "a",
    profile: Profile | None = None,
    starts: int = 0,
    faults: int = 0,
    error: str = "",
) -> Actual:
    return Actual(
        instance_id=instance,
        applied_revision=revision,
        state=state,
        profile=profile,
        last_error=error,
        listener=Listener(7100, 125),
        stream=STREAM if state is S.RUNNING else None,
        encoder=None,
        measurement=None,
        counters=Counters(starts=starts, faults=faults),
    )


def in_contact() -> Reconciler:
    reconciler = Reconciler(FIRST)
    reconciler.heard(told(), 0.0)
    return reconciler


def running(reconciler: Reconciler) -> Wish:
    wish = reconciler.ask(enabled=True, profile=Profile.LOW_BW)
    reconciler.heard(told(S.RUNNING, wish.revision, profile=Profile.LOW_BW, starts=1), 1.0)
    return wish


def test_unwanted_and_unreachable_reads_disabled() -> None:
    view = Reconciler(FIRST).view
    assert (view.state, view.last_error, view.service_reachable) == (S.DISABLED, "", False)


def test_wanted_and_unreachable_reads_faulted_and_says_what_to_do() -> None:
    reconciler = Reconciler(FIRST)
    reconciler.ask(enabled=True, profile=None)
    assert reconciler.view.state is S.FAULTED
    assert "preview service unreachable" in reconciler.view.last_error
    assert "Start or restart it" in reconciler.view.last_error
    assert reconciler.view.counters.faults == 1


def test_a_wish_made_before_the_first_contact_is_applied_at_it() -> None:
    reconciler = Reconciler(FIRST)
    wish = reconciler.ask(enabled=True, profile=None)
    assert reconciler.pending() is None
    reconciler.heard(told(), 0.0)
    assert reconciler.pending() == wish
    assert reconciler.view.state is S.STARTING
    assert wish.profile is Profile.BALANCED


def test_a_wish_without_a_profile_keeps_the_last_one_even_across_off() -> None:
    reconciler = in_contact()
    running(reconciler)
    assert reconciler.ask(enabled=False, profile=None).profile is Profile.LOW_BW
    assert reconciler.ask(enabled=True, profile=None).profile is Profile.LOW_BW


def test_the_service_lost_while_wanted_is_a_fault_and_its_return_a_restart() -> None:
    reconciler = in_contact()
    wish = running(reconciler)
    assert reconciler.pending() is None

    assert reconciler.lost("gone")
    assert reconciler.view.state is S.FAULTED
    assert reconciler.view.stream is None
    assert not reconciler.lost("still gone")

    reconciler.heard(told(instance="b"), 2.0)
    assert reconciler.pending() == wish
    assert reconciler.view.state is S.STARTING
    reconciler.heard(told(S.RUNNING, wish.revision, instance="b", starts=1, profile=Profile.LOW_BW), 3.0)
    assert reconciler.view.state is S.RUNNING
    assert reconciler.view.counters == Counters(starts=2, restarts=1, faults=1)


def test_the_same_process_seen_again_is_told_nothing_and_counts_no_restart() -> None:
    reconciler = in_contact()
    wish = running(reconciler)
    reconciler.lost("no word for 2.5 s")
    reconciler.heard(told(S.RUNNING, wish.revision, profile=Profile.LOW_BW, starts=1), 9.0)
    assert reconciler.pending() is None
    assert reconciler.view.counters == Counters(starts=1, faults=1)


def test_a_refused_wish_is_not_repeated_to_the_same_process_but_to_the_next() -> None:
    reconciler = in_contact()
    wish = reconciler.ask(enabled=True, profile=Profile.HIGH_QUALITY)
    reconciler.refused(wish, "no such profile here")
    assert reconciler.view.state is S.FAULTED
    assert "no such profile here" in reconciler.view.last_error
    assert reconciler.pending() is None
    assert reconciler.settled(wish)
    reconciler.heard(told(instance="b"), 1.0)
    assert reconciler.pending() == wish


def test_the_profile_of_a_service_without_a_wish_was_chosen_by_nobody() -> None:
    reconciler = Reconciler(FIRST)
    reconciler.heard(told(revision=0, profile=Profile.HIGH_QUALITY), 0.0)
    assert reconciler.view.profile is None
    assert reconciler.ask(enabled=True, profile=None).profile is Profile.BALANCED


def test_a_restarted_gateway_takes_the_wish_over_and_touches_nothing() -> None:
    reconciler = Reconciler(FIRST)
    reconciler.heard(told(S.RUNNING, 77, profile=Profile.HIGH_QUALITY, starts=4), 0.0)
    assert reconciler.pending() is None
    assert reconciler.view.state is S.RUNNING
    assert reconciler.wish.enabled
    assert reconciler.wish.profile is Profile.HIGH_QUALITY
    # And from then on it is the gateway's own: a new process is given it.
    reconciler.heard(told(instance="b"), 1.0)
    pending = reconciler.pending()
    assert pending is not None
    assert pending.enabled


def test_a_restarted_gateway_with_encryption_starts_a_new_session() -> None:
    reconciler = Reconciler(FIRST, new_passphrase=lambda: "made-up-passphrase")
    reconciler.heard(told(S.RUNNING, 77, profile=Profile.LOW_BW), 0.0)
    pending = reconciler.pending()
    assert pending is not None
    assert (pending.revision, pending.passphrase, pending.profile) == (
        78,
        "made-up-passphrase",
        Profile.LOW_BW,
    )


def test_a_newer_revision_than_ours_makes_ours_newer_still() -> None:
    reconciler = in_contact()
    wish = reconciler.ask(enabled=True, profile=None)
    reconciler.heard(told(revision=wish.revision + 5), 1.0)
    pending = reconciler.pending()
    assert pending == replace(wish, revision=wish.revision + 6)


def test_news_that_an_answer_has_overtaken_is_ignored() -> None:
    reconciler = in_contact()
    wish = reconciler.ask(enabled=True, profile=None)
    reconciler.heard(told(S.STARTING, wish.revision), 1.0)
    reconciler.heard(told(S.DISABLED, 0), 1.1)
    assert reconciler.view.state is S.STARTING
    assert reconciler.pending() is None


def test_an_older_wish_is_settled_by_a_newer_one() -> None:
    reconciler = in_contact()
    older = reconciler.ask(enabled=True, profile=Profile.LOW_BW)
    newer = reconciler.ask(enabled=False, profile=None)
    assert reconciler.settled(older)
    assert not reconciler.settled(newer)


def test_a_switch_has_settled_only_when_the_new_profile_is_in_force() -> None:
    reconciler = in_contact()
    running(reconciler)
    wish = reconciler.ask(enabled=True, profile=Profile.HIGH_QUALITY)
    reconciler.heard(told(S.RUNNING, wish.revision, profile=Profile.LOW_BW, starts=1), 2.0)
    assert not reconciler.settled(wish)
    reconciler.heard(told(S.RUNNING, wish.revision, profile=Profile.HIGH_QUALITY, starts=1), 3.0)
    assert reconciler.settled(wish)


def test_an_unreachable_service_settles_a_wish_after_one_more_attempt() -> None:
    reconciler = Reconciler(FIRST)
    reconciler.lost("gone")
    wish = reconciler.ask(enabled=True, profile=None)
    assert not reconciler.settled(wish)
    reconciler.lost("gone")
    assert reconciler.settled(wish)


def test_a_running_session_gets_another_passphrase_and_stays_what_it_is() -> None:
    numbers = iter(range(10))
    reconciler = Reconciler(FIRST, new_passphrase=lambda: f"passphrase-{next(numbers)}")
    assert not reconciler.renew_passphrase(), "nobody watches"
    before = reconciler.ask(enabled=True, profile=Profile.LOW_BW)
    assert reconciler.renew_passphrase()
    after = reconciler.wish
    assert (before.passphrase, after.passphrase) == ("passphrase-0", "passphrase-1")
    assert (after.enabled, after.profile) == (True, Profile.LOW_BW)
    assert after.revision > before.revision
    assert reconciler.view.passphrase == "passphrase-1"
    plain = Reconciler(FIRST)
    wish = plain.ask(enabled=True, profile=None)
    assert not plain.renew_passphrase()
    assert plain.wish == wish


def test_a_passphrase_lasts_for_a_session_and_shows_in_no_text() -> None:
    numbers = iter(range(10))
    reconciler = Reconciler(FIRST, new_passphrase=lambda: f"passphrase-{next(numbers)}")
    first = reconciler.ask(enabled=True, profile=Profile.LOW_BW)
    switched = reconciler.ask(enabled=True, profile=Profile.HIGH_QUALITY)
    off = reconciler.ask(enabled=False, profile=None)
    second = reconciler.ask(enabled=True, profile=None)
    assert [wish.passphrase for wish in (first, switched, off, second)] == [
        "passphrase-0",
        "passphrase-0",
        "",
        "passphrase-1",
    ]
    assert "passphrase-" not in repr(second) + repr(reconciler.view)


ASKS = st.tuples(st.just("ask"), st.booleans(), st.sampled_from([None, *Profile]))
WORDS = st.tuples(st.just("heard"), st.sampled_from("ab"), st.sampled_from(list(PreviewState)))
LOSSES = st.tuples(st.just("lost"), st.none(), st.none())


@given(steps=st.lists(ASKS | WORDS | LOSSES, max_size=40))
def test_whatever_happens_the_view_stays_truthful(steps: list[tuple[str, object, object]]) -> None:
    """Revisions and counts only grow, an unwanted preview without contact is off, a wanted one faulted."""
    reconciler, reachable = Reconciler(FIRST), False
    applied = {"a": 0, "b": 0}
    previous = reconciler.view.counters
    for kind, first, second in steps:
        revision = reconciler.wish.revision
        if kind == "ask":
            wish = reconciler.ask(
                enabled=bool(first), profile=second if isinstance(second, Profile) else None
            )
            assert wish.revision > revision
        elif kind == "heard":
            assert isinstance(first, str)
            assert isinstance(second, PreviewState)
            reconciler.heard(told(second, applied[first], instance=first), 0.0)
            pending = reconciler.pending()
            if pending:
                applied[first] = pending.revision
            reachable = True
        else:
            reconciler.lost("gone")
            reachable = False
        view = reconciler.view
        assert view.service_reachable == reachable
        if not reachable:
            assert view.state is (S.FAULTED if reconciler.wish.enabled else S.DISABLED)
            assert bool(view.last_error) == reconciler.wish.enabled
        assert view.counters.faults >= previous.faults
        previous = view.counters
