"""Authenticates tokens and client certificates against the current list of credentials."""

import hmac
import time
from collections.abc import Callable
from typing import Final

from common.errors import NotAuthenticatedError
from common.reasons import Reason
from gateway.access.credential import Credential, Kind, Principal, Validity
from gateway.access.store import Store
from gateway.access.token import Token, parse_token, verify

_INVALID: Final = {
    Validity.REVOKED: (Reason.CREDENTIAL_REVOKED, "was revoked"),
    Validity.EXPIRED: (Reason.CREDENTIAL_EXPIRED, "has expired"),
    Validity.NOT_YET: (Reason.CREDENTIAL_NOT_YET_VALID, "is not valid yet, by the robot's clock"),
}


class Authenticator:
    """Maps credentials to principals. Used on one event loop alone.

    Args:
        store: the list to begin with.
        clock: calendar time, seconds since 1970.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self.use(store)

    def use(self, store: Store, problem: str = "") -> None:
        """Replaces the list of credentials; a problem keeps all of them from being accepted."""
        self._problem = problem
        self._by_id = store.credentials
        self._by_fingerprint = {
            each.proof: each for each in store.credentials.values() if each.kind is Kind.CERTIFICATE
        }

    def id_of_token(self, text: str) -> str:
        """Returns the id that a token names if this robot has such a credential, else "". Proves nothing."""
        token = parse_token(text)
        return token.credential_id if token and token.credential_id in self._by_id else ""

    def knows_certificate(self, fingerprint: str) -> bool:
        """Returns whether the certificate is on the list, valid or not."""
        return fingerprint in self._by_fingerprint

    def authenticate_token(self, text: str) -> Principal:
        """Returns the principal of a token.

        Raises:
            NotAuthenticatedError: the token is unknown, wrong, or not valid now.
        """
        token = parse_token(text)
        credential = self._by_id.get(token.credential_id) if token else None
        if credential is not None and credential.kind is not Kind.TOKEN:
            credential = None
        # Malformed text is verified, too, so that its refusal takes as long as that of a wrong token.
        verified = verify(token or Token("", ""), credential.proof if credential else None)
        if credential is None or not verified:
            raise NotAuthenticatedError("the token is not one of this robot's", Reason.CREDENTIAL_UNKNOWN)
        return self._principal(credential)

    def authenticate_certificate(self, fingerprint: str) -> Principal:
        """Returns the principal of a client certificate, whose key TLS has verified (RFC 8446 4.4.3).

        Raises:
            NotAuthenticatedError: the certificate is unknown, or not valid now.
        """
        credential = self._by_fingerprint.get(fingerprint)
        if credential is None or not hmac.compare_digest(credential.proof, fingerprint):
            raise NotAuthenticatedError(
                "the client certificate is not one of this robot's", Reason.CREDENTIAL_UNKNOWN
            )
        return self._principal(credential)

    def accepts(self, token: str | None, fingerprint: str | None) -> bool:
        """Returns whether each credential that a caller shows is valid now. Takes microseconds."""
        try:
            if token is not None:
                self.authenticate_token(token)
            if fingerprint is not None:
                self.authenticate_certificate(fingerprint)
        except NotAuthenticatedError:
            return False
        return token is not None or fingerprint is not None

    def access_lost(self) -> NotAuthenticatedError:
        """Returns the error for a caller that is no longer `still_valid`."""
        if self._problem:
            return self._unreadable()
        return NotAuthenticatedError(
            "the credential of this call is no longer valid; what it requested may have been done",
            Reason.CREDENTIAL_REVOKED,
        )

    def still_valid(self, principal: Principal) -> bool:
        """Returns whether all credentials of the principal are valid now and still grant its role."""
        if self._problem:
            return False
        now_s = self._clock()
        credentials = [self._by_id.get(each) for each in principal.credential_ids]
        return all(
            each is not None and each.validity(now_s) is Validity.VALID and each.role.may(principal.role)
            for each in credentials
        )

    def _unreadable(self) -> NotAuthenticatedError:
        return NotAuthenticatedError(
            f"this robot can't read which credentials are revoked: {self._problem}",
            Reason.CREDENTIALS_UNREADABLE,
        )

    def _principal(self, credential: Credential) -> Principal:
        if self._problem:
            raise self._unreadable()
        state = credential.validity(self._clock())
        if state is not Validity.VALID:
            reason, problem = _INVALID[state]
            what = f"the {credential.kind.value} of {credential.name} ({credential.credential_id}) {problem}"
            raise NotAuthenticatedError(what, reason)
        return Principal(credential.name, credential.role, (credential.credential_id,))


def combined(first: Principal, second: Principal) -> Principal:
    """Returns the principal of a caller who presents two credentials, with the lower of both roles.

    Raises:
        NotAuthenticatedError: the credentials have different names.
    """
    if first.name != second.name:
        raise NotAuthenticatedError(
            f"the certificate belongs to {first.name}, but the token does not", Reason.CREDENTIAL_UNKNOWN
        )
    role = second.role if first.role.may(second.role) else first.role
    return Principal(first.name, role, (*first.credential_ids, *second.credential_ids))
