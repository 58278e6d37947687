"""The preview's rows of the failure table of gateway.links, and a random walk against its invariants."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.links.link import ServiceLink
from gateway.links.preview.control import PreviewControl
from gateway.links.preview.model import PreviewModel, PreviewReconciler
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.preview.wire import PreviewConnector
from gateway.links.reconciler import Desired
from gateway.status.preview import Counters, Listener, Measurement, PreviewState, Profile, Stream
from gateway.status.preview import PreviewState as S

FIRST = 1000
LOOPBACK, ELSEWHERE = "127.0.0.1", "10.0.0.5"
STREAM = Stream(1280, 720, 30.0, 2500, None, False, "")


def report(
    state: PreviewState = S.DISABLED,
    revision: int = 0,
    *,
    instance: str = "a",
    profile: Profile | None = None,
    starts: int = 0,
    faults: int = 0,
    error: str = "",
    measurement: Measurement | None = None,
    address: str | None = LOOPBACK,
    encrypted: bool = False,
) -> PreviewReport:
    return PreviewReport(
        instance_id=instance,
        applied_revision=revision,
        state=state,
        profile=profile,
        last_error=error,
        listener=None if address is None else Listener(7100, 125, address),
        stream=replace(STREAM, encrypted=encrypted) if state is S.RUNNING else None,
        encoder=None,
        measurement=measurement,
        counters=Counters(starts=starts, faults=faults),
    )


class Preview(PreviewReconciler):
    """A reconciler of the preview, whose requests are worded as operators word them."""

    def __init__(self) -> None:
        numbers = iter(range(10))
        self.model = PreviewModel(lambda address: address != LOOPBACK, lambda: f"passphrase-{next(numbers)}")
        super().__init__(FIRST, self.model)

    def switch(self, enabled: bool, profile: Profile | None = None) -> Desired[PreviewSpec]:
        return self.request(self.desired.spec.switched(enabled=enabled, profile=profile))


def connected(address: str | None = LOOPBACK) -> Preview:
    preview = Preview()
    preview.take_report(report(address=address), 0.0)
    return preview


def control_of(preview: Preview) -> PreviewControl:
    return PreviewControl(ServiceLink("preview", PreviewConnector(Path("/nonexistent")), preview), 1.0)


def running(preview: Preview) -> Desired[PreviewSpec]:
    desired = preview.switch(True, Profile.LOW_BW)
    preview.take_report(report(S.RUNNING, desired.revision, profile=Profile.LOW_BW, starts=1), 1.0)
    return desired


def test_off_and_unreachable_reads_disabled() -> None:
    view = Preview().view
    assert (view.state, view.last_error, view.service_reachable) == (S.DISABLED, "", False)


def test_on_and_unreachable_reads_faulted_and_says_what_to_do() -> None:
    preview = Preview()
    preview.switch(True)
    assert preview.view.state is S.FAULTED
    assert "preview service unreachable" in preview.view.last_error
    assert "Start or restart it" in preview.view.last_error
    assert preview.view.counters.faults == 1


def test_a_request_before_the_first_contact_is_applied_at_it() -> None:
    preview = Preview()
    desired = preview.switch(True)
    assert preview.pending() is None
    preview.take_report(report(), 0.0)
    assert preview.pending() == desired
    assert preview.view.state is S.STARTING
    assert desired.spec.profile is Profile.BALANCED


def test_a_request_without_a_profile_keeps_the_last_one_even_across_off() -> None:
    preview = connected()
    running(preview)
    assert preview.switch(False).spec.profile is Profile.LOW_BW
    assert preview.switch(True).spec.profile is Profile.LOW_BW


def test_the_service_lost_while_on_is_a_fault_and_its_return_a_restart() -> None:
    preview = connected()
    desired = running(preview)
    assert preview.pending() is None

    assert preview.take_loss("gone")
    assert (preview.view.state, preview.view.stream) == (S.FAULTED, None)
    assert not preview.take_loss("still gone")

    preview.take_report(report(instance="b"), 2.0)
    assert (preview.pending(), preview.view.state) == (desired, S.STARTING)
    preview.take_report(
        report(S.RUNNING, desired.revision, instance="b", starts=1, profile=Profile.LOW_BW), 3.0
    )
    assert preview.view.state is S.RUNNING
    assert preview.view.counters == Counters(starts=2, restarts=1, faults=1)


def test_the_same_process_seen_again_is_sent_nothing_and_counts_no_restart() -> None:
    preview = connected()
    desired = running(preview)
    preview.take_loss("no report for 2.5 s")
    preview.take_report(report(S.RUNNING, desired.revision, profile=Profile.LOW_BW, starts=1), 9.0)
    assert preview.pending() is None
    assert preview.view.counters == Counters(starts=1, faults=1)


def test_a_refused_request_is_quoted_and_counts_as_a_fault() -> None:
    preview = connected()
    desired = preview.switch(True, Profile.HIGH_QUALITY)
    preview.take_refusal(desired, "no such profile here")
    assert preview.view.state is S.FAULTED
    assert "no such profile here" in preview.view.last_error
    assert preview.view.counters.faults == 1
    assert preview.settled(desired)


def test_looking_at_the_view_counts_nothing() -> None:
    preview = Preview()
    preview.switch(True)
    preview.take_loss("nothing answers on its socket")
    assert preview.model.view(preview) == preview.model.view(preview) == preview.view
    assert preview.view.counters.faults == 1


def test_a_fault_that_the_service_reports_is_counted_by_the_service_alone() -> None:
    preview = connected()
    desired = preview.switch(True)
    preview.take_report(report(S.FAULTED, desired.revision, faults=1, error="no camera"), 1.0)
    assert (preview.view.last_error, preview.view.counters.faults) == ("no camera", 1)


def test_the_default_profile_of_a_service_without_a_request_is_not_adopted() -> None:
    preview = Preview()
    preview.take_report(report(revision=0, profile=Profile.HIGH_QUALITY), 0.0)
    assert preview.view.profile is None
    assert preview.switch(True).spec.profile is Profile.BALANCED


def test_a_restarted_gateway_adopts_the_running_preview_and_changes_nothing() -> None:
    preview = Preview()
    preview.take_report(report(S.RUNNING, 77, profile=Profile.HIGH_QUALITY, starts=4), 0.0)
    assert preview.pending() is None
    assert preview.view.state is S.RUNNING
    assert preview.desired.spec.enabled
    assert preview.desired.spec.profile is Profile.HIGH_QUALITY
    # And from then on it is the gateway's own: a new process gets it.
    preview.take_report(report(instance="b"), 1.0)
    pending = preview.pending()
    assert pending is not None
    assert pending.spec.enabled


@pytest.mark.parametrize("encrypted", [False, True])
def test_a_restarted_gateway_with_encryption_starts_a_new_session(encrypted: bool) -> None:
    preview = Preview()
    adopted = report(S.RUNNING, 77, profile=Profile.LOW_BW, address=ELSEWHERE, encrypted=encrypted)
    preview.take_report(adopted, 0.0)
    assert preview.pending() == Desired(78, PreviewSpec(True, Profile.LOW_BW, "passphrase-0"))


@pytest.mark.parametrize("state", [S.RUNNING, S.STARTING, S.FAULTED])
def test_a_restarted_gateway_without_encryption_opens_the_session_of_one_with_it(state: PreviewState) -> None:
    preview = Preview()
    preview.take_report(report(state, 77, profile=Profile.LOW_BW, encrypted=True), 0.0)
    assert preview.pending() == Desired(78, PreviewSpec(True, Profile.LOW_BW))


@pytest.mark.parametrize("address", [ELSEWHERE, "", None])
def test_what_is_asked_for_before_the_first_contact_is_encrypted_by_where_the_listener_turns_out_to_be(
    address: str | None,
) -> None:
    preview = Preview()
    desired = preview.switch(True, Profile.LOW_BW)
    assert desired.spec.passphrase == ""
    preview.take_report(report(address=address), 0.0)
    # Under the revision that its caller waits for.
    expected = PreviewSpec(True, Profile.LOW_BW, "passphrase-0")
    assert preview.pending() == Desired(desired.revision, expected)


def test_a_service_that_comes_back_on_other_addresses_never_gets_the_plain_session() -> None:
    preview = connected()
    desired = running(preview)
    preview.take_loss("gone")
    preview.take_report(report(instance="b", address=ELSEWHERE), 2.0)
    pending = preview.pending()
    assert pending
    assert pending.spec == PreviewSpec(True, Profile.LOW_BW, "passphrase-0")
    preview.take_report(report(S.RUNNING, pending.revision, instance="b", address=ELSEWHERE), 3.0)
    preview.take_loss("gone")
    preview.take_report(report(instance="c"), 4.0)
    pending = preview.pending()
    assert pending
    assert pending.spec == desired.spec, "on loopback again, it is plain again"


def test_the_same_process_with_another_listener_gets_a_revision_of_its_own() -> None:
    preview = connected()
    desired = running(preview)
    preview.take_report(report(S.RUNNING, desired.revision, address=ELSEWHERE), 2.0)
    pending = preview.pending()
    assert pending
    assert pending.revision == desired.revision + 1
    assert pending.spec.passphrase == "passphrase-0"


def test_a_switch_has_settled_only_when_the_stream_has_the_new_profile() -> None:
    preview = connected()
    running(preview)
    desired = preview.switch(True, Profile.HIGH_QUALITY)
    preview.take_report(report(S.RUNNING, desired.revision, profile=Profile.LOW_BW, starts=1), 2.0)
    assert not preview.settled(desired)
    preview.take_report(report(S.RUNNING, desired.revision, profile=Profile.HIGH_QUALITY, starts=1), 3.0)
    assert preview.settled(desired)


def test_off_has_settled_only_when_the_pipeline_is_gone() -> None:
    preview = connected()
    running(preview)
    desired = preview.switch(False)
    preview.take_report(report(S.STOPPING, desired.revision, starts=1), 2.0)
    assert not preview.settled(desired)
    preview.take_report(report(S.DISABLED, desired.revision, starts=1), 3.0)
    assert preview.settled(desired)


def test_figures_stay_while_the_service_is_unreachable_and_go_with_the_preview() -> None:
    figures = Measurement(30.0, 2400.0, 1, 10, None, None)
    preview = connected()
    desired = preview.switch(True)
    preview.take_report(report(S.RUNNING, desired.revision, measurement=figures), 5.0)
    preview.take_loss("gone")
    assert preview.view.measured is not None
    assert (preview.view.measured.value, preview.view.measured.at_s) == (figures, 5.0)
    preview.switch(False)
    assert preview.view.measured is None


def test_a_running_session_gets_another_passphrase_and_stays_as_it_is() -> None:
    preview = connected(ELSEWHERE)
    control = control_of(preview)
    untouched = preview.desired
    control.renew_passphrase()
    assert preview.desired is untouched, "nothing runs"
    before = preview.switch(True, Profile.LOW_BW)
    control.renew_passphrase()
    after = preview.desired
    assert (before.spec.passphrase, after.spec.passphrase) == ("passphrase-0", "passphrase-1")
    assert replace(after.spec, passphrase="") == PreviewSpec(True, Profile.LOW_BW)
    assert after.revision > before.revision
    assert preview.view.passphrase == "passphrase-1"


def test_a_session_without_encryption_has_no_passphrase_to_renew() -> None:
    preview = connected()
    desired = preview.switch(True)
    control_of(preview).renew_passphrase()
    assert preview.desired is desired


def test_a_passphrase_lasts_for_a_session_and_shows_in_no_text() -> None:
    preview = connected(ELSEWHERE)
    first = preview.switch(True, Profile.LOW_BW)
    switched = preview.switch(True, Profile.HIGH_QUALITY)
    off = preview.switch(False)
    second = preview.switch(True)
    assert [desired.spec.passphrase for desired in (first, switched, off, second)] == [
        "passphrase-0",
        "passphrase-0",
        "",
        "passphrase-1",
    ]
    assert "passphrase-" not in repr(second) + str(second.spec) + repr(preview.view)


REQUESTS = st.tuples(st.just("request"), st.booleans(), st.sampled_from([None, *Profile]))
REPORTS = st.tuples(st.just("report"), st.sampled_from("ab"), st.sampled_from(list(PreviewState)))
LOSSES = st.tuples(st.just("loss"), st.none(), st.none())


@given(steps=st.lists(REQUESTS | REPORTS | LOSSES, max_size=40))
def test_the_view_agrees_with_every_history(steps: list[tuple[str, object, object]]) -> None:
    """Revisions and counts only grow; without contact the preview reads faulted if it shall run.

    The listener of process b is reached from other machines: it is never sent a stream without a passphrase.
    """
    preview, reachable = Preview(), False
    applied, addresses = {"a": 0, "b": 0}, {"a": LOOPBACK, "b": ELSEWHERE}
    sent: dict[tuple[str, int], PreviewSpec] = {}
    previous = preview.view
    for kind, first, second in steps:
        revision = preview.desired.revision
        if kind == "request":
            desired = preview.switch(bool(first), second if isinstance(second, Profile) else None)
            assert desired.revision > revision
        elif kind == "report":
            assert isinstance(first, str)
            assert isinstance(second, PreviewState)
            preview.take_report(report(second, applied[first], instance=first, address=addresses[first]), 0.0)
            pending = preview.pending()
            if pending:
                applied[first] = pending.revision
                assert bool(pending.spec.passphrase) == (pending.spec.enabled and first == "b")
                assert sent.setdefault((first, pending.revision), pending.spec) == pending.spec
            elif first == "b":
                assert bool(preview.desired.spec.passphrase) == preview.desired.spec.enabled
            reachable = True
        else:
            preview.take_loss("gone")
            reachable = False
        view = preview.view
        assert view.service_reachable == reachable
        if not reachable:
            assert view.state is (S.FAULTED if preview.desired.spec.enabled else S.DISABLED)
            assert bool(view.last_error) == preview.desired.spec.enabled
        assert view.counters.faults >= previous.counters.faults
        assert (view is previous) == (view == previous), "a new object for each change, and for nothing else"
        previous = view


@pytest.mark.parametrize(
    ("spec", "text"),
    [
        (PreviewSpec(), "off"),
        (PreviewSpec(True, Profile.BALANCED), "on, balanced"),
        (PreviewSpec(True, Profile.BALANCED, camera="rear"), "on, balanced, camera rear"),
        (PreviewSpec(True, Profile.BALANCED, camera="camera"), "on, balanced"),
    ],
)
def test_a_request_names_the_camera_unless_it_is_the_only_one(spec: PreviewSpec, text: str) -> None:
    assert str(spec) == text
