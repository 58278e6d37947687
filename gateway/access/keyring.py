"""Finds out who shows a credential: the newest store, looked at in every call."""

import hmac
import time
from collections.abc import Callable
from typing import Final

from common.errors import NotAuthenticatedError
from common.reasons import Reason
from gateway.access.credential import Credential, Kind, Principal, State
from gateway.access.store import Store
from gateway.access.token import Token, is_token, parse_token

_OVER: Final = {
    State.REVOKED: (Reason.CREDENTIAL_REVOKED, "was revoked"),
    State.EXPIRED: (Reason.CREDENTIAL_EXPIRED, "has expired"),
    State.NOT_YET: (Reason.CREDENTIAL_NOT_YET_VALID, "is not valid yet, by the robot's clock"),
}


class Keyring:
    """Belongs to one event loop.

    Args:
        clock: the calendar clock, in seconds since 1970.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self.use(store)

    def use(self, store: Store) -> None:
        """From now on these credentials count, and no others."""
        self._by_id = store.credentials
        self._by_fingerprint = {
            each.proof: each for each in store.credentials.values() if each.kind is Kind.CERTIFICATE
        }

    def owner(self, token_text: str) -> str:
        """The id of the credential that a token names; empty when there is none. Proves nothing."""
        token = parse_token(token_text)
        return token.credential_id if token and token.credential_id in self._by_id else ""

    def knows_certificate(self, fingerprint: str) -> bool:
        """Whether the list has this certificate, valid or not."""
        return fingerprint in self._by_fingerprint

    def of_token(self, text: str) -> Principal:
        """Who shows this token.

        Raises:
            NotAuthenticatedError: it is none of ours, or not valid now.
        """
        token = parse_token(text)
        credential = self._by_id.get(token.credential_id) if token else None
        if credential is not None and credential.kind is not Kind.TOKEN:
            credential = None
        # A text that is no token takes the same way as a wrong one.
        shown = token or Token("", "")
        right = is_token(shown, credential.proof if credential else None)
        if credential is None or not right:
            raise NotAuthenticatedError("the token is none of this robot's", Reason.CREDENTIAL_UNKNOWN)
        return self._principal(credential)

    def of_certificate(self, fingerprint: str) -> Principal:
        """Who shows this certificate, of which TLS has proved that the key is there, too.

        Raises:
            NotAuthenticatedError: it is none of ours, or not valid now.
        """
        credential = self._by_fingerprint.get(fingerprint)
        if credential is None or not hmac.compare_digest(credential.proof, fingerprint):
            raise NotAuthenticatedError(
                "the client certificate is none of this robot's", Reason.CREDENTIAL_UNKNOWN
            )
        return self._principal(credential)

    def still_valid(self, principal: Principal) -> bool:
        """Whether all that somebody proved who they are by is still good, for the same role."""
        now_s = self._clock()
        kept = [self._by_id.get(each) for each in principal.credential_ids]
        return all(
            each is not None and each.state(now_s) is State.VALID and each.role.may(principal.role)
            for each in kept
        )

    def _principal(self, credential: Credential) -> Principal:
        state = credential.state(self._clock())
        if state is not State.VALID:
            reason, words = _OVER[state]
            what = f"the {credential.kind.value} of {credential.name} ({credential.credential_id}) {words}"
            raise NotAuthenticatedError(what, reason)
        return Principal(credential.name, credential.role, (credential.credential_id,))


def both(first: Principal, second: Principal) -> Principal:
    """Somebody who shows two credentials: known by the first, allowed what both allow.

    Raises:
        NotAuthenticatedError: they are two people's.
    """
    if first.name != second.name:
        raise NotAuthenticatedError(
            f"the certificate is {first.name}'s and the token is somebody else's", Reason.CREDENTIAL_UNKNOWN
        )
    role = second.role if first.role.may(second.role) else first.role
    return Principal(first.name, role, (*first.credential_ids, *second.credential_ids))
