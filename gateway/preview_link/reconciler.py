"""Decides: from the wish and from what was heard, what to apply and what to tell. Pure; one owner."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from gateway.preview_link.actual import Actual
from gateway.preview_link.counters import Ledger
from gateway.preview_link.wish import Wish
from gateway.status.preview import Measurement, PreviewState, PreviewView, Profile
from gateway.status.values import Received

_ALIVE: Final = frozenset({PreviewState.STARTING, PreviewState.RUNNING, PreviewState.FAULTED})
"""States of a service that was told to have a preview."""
_UNREACHABLE: Final = (
    "preview service unreachable ({trouble}). Start or restart it; the gateway connects by itself"
)


class Reconciler:
    """The gateway's whole knowledge of the preview.

    Args:
        first_revision: larger than any that an earlier gateway of this boot gave out.
        new_passphrase: makes one per session; None where streams are not encrypted.
    """

    def __init__(self, first_revision: int, new_passphrase: Callable[[], str] | None = None) -> None:
        self._new_passphrase = new_passphrase
        self._wish = Wish(first_revision, enabled=False, profile=None)
        self._ours = False
        """Whether the wish was made or taken over by this gateway."""
        self._applied_once = False
        """Whether any process of the service has taken the present wish in."""
        self._heard: Received[Actual] | None = None
        """The last word of the service, kept when the contact is lost."""
        self._trouble: str | None = "not connected yet"
        """Why there is no contact; None when there is."""
        self._failures = 0
        self._failures_at_wish = 0
        self._refusal: tuple[str, int, str] | None = None
        """Instance and revision that don't go together, and the service's words."""
        self._ledger = Ledger()
        self.view = self._seen()

    @property
    def wish(self) -> Wish:
        """What is wanted now."""
        return self._wish

    def ask(self, *, enabled: bool, profile: Profile | None, request_id: str = "") -> Wish:
        """A new wish of an operator; without a profile the last one stays, BALANCED when there is none."""
        profile = profile or self._wish.profile
        if enabled and profile is None:
            profile = Profile.BALANCED
        passphrase = self._wish.passphrase if self._wish.enabled else ""
        if enabled and not passphrase and self._new_passphrase:
            passphrase = self._new_passphrase()
        revision = max(self._wish.revision, self._applied_revision()) + 1
        self._wish = Wish(revision, enabled, profile, passphrase if enabled else "", request_id)
        self._ours, self._applied_once = True, False
        self._failures_at_wish = self._failures
        self._publish()
        return self._wish

    def renew_passphrase(self) -> bool:
        """Another passphrase for the running session, if it has one; returns whether it has."""
        if not (self._wish.enabled and self._wish.passphrase and self._new_passphrase):
            return False
        self._wish = replace(self._wish, passphrase="")
        self.ask(enabled=True, profile=None)
        return True

    def heard(self, actual: Actual, now_s: float) -> bool:
        """Takes in what the service says; returns whether there was no contact before."""
        if self._is_overtaken(actual):
            return False
        regained = self._trouble is not None
        self._trouble = None
        self._heard = Received(actual, now_s)
        if not self._ours:
            self._take_over(actual)
        elif actual.applied_revision > self._wish.revision:
            self._wish = replace(self._wish, revision=actual.applied_revision + 1)
        if actual.applied_revision == self._wish.revision:
            self._applied_once = True
        elif self._applied_once and self._wish.enabled:
            self._ledger.next_start_is_restart()
        self._ledger.heard(actual.instance_id, actual.counters)
        self._publish()
        return regained

    def refused(self, wish: Wish, words: str) -> None:
        """The service won't take this wish; no use in repeating it to the same process."""
        if self._heard:
            self._refusal = (self._heard.value.instance_id, wish.revision, words)
            self._publish()

    def lost(self, trouble: str) -> bool:
        """There is no contact; returns whether that is news."""
        was_in_contact = self._trouble is None
        self._trouble = trouble
        self._failures += 1
        self._publish()
        return was_in_contact

    def pending(self) -> Wish | None:
        """The wish that the service must be told, None when it has it or can't be told."""
        if self._trouble is not None or self._refused_words() is not None:
            return None
        return self._wish if self._applied_revision() != self._wish.revision else None

    def settled(self, wish: Wish) -> bool:
        """Whether waiting longer tells nothing new about this wish."""
        if wish.revision != self._wish.revision or self._refused_words() is not None:
            return True
        if self._trouble is not None:
            return self._failures > self._failures_at_wish
        if self._applied_revision() != wish.revision:
            return False
        if not wish.enabled:
            return self.view.state is PreviewState.DISABLED
        if self.view.state is PreviewState.RUNNING:
            return self.view.profile is wish.profile
        return self.view.state is PreviewState.FAULTED

    def _take_over(self, actual: Actual) -> None:
        """First contact, and nobody has asked yet: what an earlier gateway had applied stays in force."""
        self._ours = True
        enabled = actual.state in _ALIVE
        # A service without a wish names the profile it would take; nobody chose it.
        chosen = actual.profile if actual.applied_revision else None
        self._wish = replace(
            self._wish,
            revision=actual.applied_revision,
            enabled=enabled,
            profile=chosen or self._wish.profile,
        )
        if enabled and self._new_passphrase and not self._wish.passphrase:
            self.ask(enabled=True, profile=None)

    def _is_overtaken(self, actual: Actual) -> bool:
        """Whether an answer with a newer revision has come in before this message of the stream."""
        last = self._heard.value if self._heard else None
        return (
            last is not None
            and self._trouble is None
            and last.instance_id == actual.instance_id
            and actual.applied_revision < last.applied_revision
        )

    def _applied_revision(self) -> int:
        return self._heard.value.applied_revision if self._heard else 0

    def _refused_words(self) -> str | None:
        if self._heard is None or self._refusal is None:
            return None
        instance_id, revision, words = self._refusal
        current = (self._heard.value.instance_id, self._wish.revision)
        return words if (instance_id, revision) == current else None

    def _publish(self) -> None:
        before = self.view.state
        after = self._seen()
        ours = not after.service_reachable or self._refused_words() is not None
        if ours and after.state is PreviewState.FAULTED and before is not PreviewState.FAULTED:
            self._ledger.fault()
            after = replace(after, counters=self._ledger.total)
        self.view = after

    def _seen(self) -> PreviewView:
        """What a client may learn."""
        actual = self._heard.value if self._heard else None
        state, last_error = self._state()
        reachable = self._trouble is None
        pipeline = actual if reachable else None
        profile = self._wish.profile
        if pipeline and pipeline.stream and pipeline.profile:
            profile = pipeline.profile
        return PreviewView(
            state=state,
            profile=profile,
            last_error=last_error,
            service_reachable=reachable,
            listener=actual.listener if actual else None,
            stream=pipeline.stream if pipeline else None,
            encoder=pipeline.encoder if pipeline else None,
            measured=self._measured(state),
            counters=self._ledger.total,
            passphrase=self._wish.passphrase,
        )

    def _state(self) -> tuple[PreviewState, str]:
        """The state, and what went wrong."""
        if self._trouble is not None or self._heard is None:
            if self._wish.enabled:
                return PreviewState.FAULTED, _UNREACHABLE.format(trouble=self._trouble)
            return PreviewState.DISABLED, ""
        words = self._refused_words()
        if words is not None:
            return PreviewState.FAULTED, f"preview service refused the request: {words}"
        actual = self._heard.value
        if actual.state is PreviewState.DISABLED and self._wish.enabled and self.pending():
            return PreviewState.STARTING, ""  # The wish is on its way.
        return actual.state, "" if actual.state is PreviewState.RUNNING else actual.last_error

    def _measured(self, state: PreviewState) -> Received[Measurement] | None:
        """The newest figures; without contact they stay and grow stale, with the pipeline they go."""
        if self._heard is None or self._heard.value.measurement is None or state is PreviewState.DISABLED:
            return None
        return Received(self._heard.value.measurement, self._heard.at_s)
