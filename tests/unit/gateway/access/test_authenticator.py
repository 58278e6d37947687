"""Authentication: each state of a credential, and two credentials at once."""

from types import MappingProxyType

import pytest

from common.errors import NotAuthenticatedError
from common.reasons import Reason
from gateway.access.authenticator import Authenticator, combined
from gateway.access.credential import Credential, Kind, Principal, Validity
from gateway.access.role import Role
from gateway.access.store import Store
from gateway.access.token import Token, hash_of, new_token

NOW_S = 1_000_000.0
SHOWN = new_token("a" * 12)
FINGERPRINT = "f" * 64


def credential(**changed: object) -> Credential:
    values: dict[str, object] = {
        "credential_id": SHOWN.credential_id,
        "name": "anna",
        "role": Role.OPERATOR,
        "kind": Kind.TOKEN,
        "proof": hash_of(SHOWN),
        "made_s": 0,
    }
    return Credential(**values | changed)  # type: ignore[arg-type]  # a test's short hand


def authenticator(*credentials: Credential) -> Authenticator:
    store = Store(MappingProxyType({each.credential_id: each for each in credentials}))
    return Authenticator(store, lambda: NOW_S)


@pytest.mark.parametrize(
    ("changed", "state", "reason"),
    [
        ({"revoked_s": 5}, Validity.REVOKED, Reason.CREDENTIAL_REVOKED),
        ({"revoked_s": 2_000_000}, Validity.REVOKED, Reason.CREDENTIAL_REVOKED),
        ({"ends_s": 1_000_000}, Validity.EXPIRED, Reason.CREDENTIAL_EXPIRED),
        ({"begins_s": 1_000_001}, Validity.NOT_YET, Reason.CREDENTIAL_NOT_YET_VALID),
        ({"begins_s": 1_000_001, "revoked_s": 5}, Validity.REVOKED, Reason.CREDENTIAL_REVOKED),
    ],
)
def test_an_invalid_credential_is_refused_with_its_reason(
    changed: dict[str, object], state: Validity, reason: Reason
) -> None:
    kept = credential(**changed)
    assert kept.validity(NOW_S) is state
    with pytest.raises(NotAuthenticatedError) as caught:
        authenticator(kept).authenticate_token(SHOWN.text())
    assert caught.value.reason is reason
    assert SHOWN.secret not in str(caught.value)


@pytest.mark.parametrize("changed", [{}, {"begins_s": 1_000_000}, {"ends_s": 1_000_001}])
def test_a_valid_credential_authenticates(changed: dict[str, object]) -> None:
    kept = authenticator(credential(**changed))
    found = kept.authenticate_token(SHOWN.text())
    assert found == Principal("anna", Role.OPERATOR, (SHOWN.credential_id,))
    assert kept.still_valid(found)


def test_the_cause_of_an_unknown_token_is_not_revealed() -> None:
    """A wrong secret, an unknown id, a certificate's id: one answer."""
    certificate = credential(kind=Kind.CERTIFICATE, proof=FINGERPRINT)
    cases = (
        (authenticator(credential()), Token(SHOWN.credential_id, "A" * 43).text()),
        (authenticator(), SHOWN.text()),
        (authenticator(certificate), SHOWN.text()),
        (authenticator(credential()), "not a token"),
        (authenticator(credential()), ""),
    )
    said = set()
    for kept, text in cases:
        with pytest.raises(NotAuthenticatedError) as caught:
            kept.authenticate_token(text)
        said.add((str(caught.value), caught.value.reason))
    assert len(said) == 1


def test_a_tokens_hash_is_no_fingerprint() -> None:
    kept = authenticator(credential())
    with pytest.raises(NotAuthenticatedError):
        kept.authenticate_certificate(hash_of(SHOWN))


def test_a_principal_is_invalid_when_its_credential_is_changed_revoked_or_gone() -> None:
    kept = authenticator(credential())
    found = kept.authenticate_token(SHOWN.text())
    for changed in ((credential(revoked_s=5),), (credential(role=Role.VIEWER),), ()):
        kept.use(Store(MappingProxyType({each.credential_id: each for each in changed})))
        assert not kept.still_valid(found)
    kept.use(Store(MappingProxyType({SHOWN.credential_id: credential(role=Role.ADMIN)})))
    assert kept.still_valid(found)


def test_two_credentials_allow_what_both_allow() -> None:
    viewer, admin = Principal("anna", Role.VIEWER, ("a",)), Principal("anna", Role.ADMIN, ("b",))
    assert combined(viewer, admin) == Principal("anna", Role.VIEWER, ("a", "b"))
    assert combined(admin, viewer) == Principal("anna", Role.VIEWER, ("b", "a"))
    with pytest.raises(NotAuthenticatedError):
        combined(viewer, Principal("ben", Role.ADMIN, ("c",)))


def test_each_role_includes_the_ones_before_it() -> None:
    ladder = list(Role)
    for place, role in enumerate(ladder):
        assert [role.may(needed) for needed in ladder] == [other <= place for other in range(len(ladder))]
