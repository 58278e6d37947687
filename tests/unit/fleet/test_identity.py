"""Tokens and keys in the scheme of NATS; that servers accept them, the integration tests show."""

import base64
import json
from pathlib import Path
from typing import Any

import nkeys
import pytest

from fleet.errors import RefusedError
from fleet.identity import (
    Account,
    Credentials,
    Key,
    KeyKind,
    Permissions,
    Service,
    account_jwt,
    new_user,
    operator_jwt,
)


def claims(token: str, signer: Key) -> dict[str, Any]:
    """The content of a token, once its signature is checked."""
    signed, _, signature = token.rpartition(".")
    padded = signature + "=" * (-len(signature) % 4)
    pair = nkeys.from_seed(bytearray(signer.seed))
    assert pair.verify(signed.encode(), base64.urlsafe_b64decode(padded))
    content = signed.partition(".")[2]
    result: dict[str, Any] = json.loads(base64.urlsafe_b64decode(content + "=" * (-len(content) % 4)))
    assert result["iss"] == signer.public
    return result


@pytest.mark.parametrize(
    ("kind", "letter"), [(KeyKind.OPERATOR, "O"), (KeyKind.ACCOUNT, "A"), (KeyKind.USER, "U")]
)
def test_a_public_key_shows_its_kind(kind: KeyKind, letter: str) -> None:
    key = Key.new(kind)
    assert key.public.startswith(letter)
    assert len(key.public) == 56
    assert key.seed.decode() not in repr(key)


def test_an_operator_names_the_system_account() -> None:
    operator = Key.new(KeyKind.OPERATOR)
    found = claims(operator_jwt(operator, "lab", "ASYS"), operator)
    assert (found["sub"], found["name"], found["nats"]["system_account"]) == (operator.public, "lab", "ASYS")


def test_only_an_account_that_stores_has_streams() -> None:
    operator = Key.new(KeyKind.OPERATOR)
    with_streams = claims(
        account_jwt(operator, "AFLEET", Account("fleet", stores=True), issued_unix_s=1), operator
    )
    without = claims(account_jwt(operator, "AROBOTS", Account("robots"), issued_unix_s=1), operator)
    assert "disk_storage" in with_streams["nats"]["limits"]
    assert "disk_storage" not in without["nats"]["limits"]


def test_an_account_has_its_services_and_revocations() -> None:
    operator = Key.new(KeyKind.OPERATOR)
    service = Service("fleet.*.up.*", many=True)
    account = Account("robots", imports=(("AFLEET", service),), revoked={"UROBOT": 7})
    found = claims(account_jwt(operator, "AROBOTS", account, issued_unix_s=1), operator)["nats"]
    assert found["revocations"] == {"UROBOT": 7}
    assert [(each["account"], each["subject"]) for each in found["imports"]] == [("AFLEET", "fleet.*.up.*")]


def test_a_user_may_do_what_is_named() -> None:
    account = Key.new(KeyKind.ACCOUNT)
    creds, public = new_user(account, "r1", Permissions(("a.>",), ("b",), 5, 16, 1024), expires_unix_s=99)
    found = claims(creds.jwt, account)
    assert (found["sub"], found["exp"]) == (public, 99)
    assert found["nats"]["pub"] == {"allow": ["a.>"]}
    assert found["nats"]["sub"] == {"allow": ["b"]}
    assert found["nats"]["resp"]["ttl"] == 5_000_000_000
    assert (found["nats"]["subs"], found["nats"]["payload"]) == (16, 1024)


def test_a_user_without_permissions_may_do_nothing() -> None:
    """An empty list of allowed subjects would mean all."""
    account = Key.new(KeyKind.ACCOUNT)
    creds, _ = new_user(account, "r1", Permissions((), ()))
    found = claims(creds.jwt, account)["nats"]
    assert found["pub"] == found["sub"] == {"deny": [">"]}
    assert "exp" not in claims(creds.jwt, account)


def test_credentials_are_read_as_they_were_written(tmp_path: Path) -> None:
    creds, _ = new_user(Key.new(KeyKind.ACCOUNT), "r1", Permissions(("a",), ("b",)))
    path = tmp_path / "r1.creds"
    path.write_text(creds.text(), encoding="ascii")
    assert Credentials.read(path) == creds


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe", b"-----BEGIN NATS USER JWT-----", b"-----BEGIN USER NKEY SEED-----\nSU\n"]
)
def test_what_is_no_credentials_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "r1.creds"
    path.write_bytes(content)
    with pytest.raises(RefusedError, match=r"r1\.creds"):
        Credentials.read(path)
    with pytest.raises(RefusedError, match="can't be read"):
        Credentials.read(tmp_path / "missing")


@pytest.mark.parametrize("seed", [b"", b"SUA", b"not base32!", b"A" * 58])
def test_a_seed_may_be_anything(seed: bytes) -> None:
    with pytest.raises(RefusedError, match="no valid seed"):
        Key(seed).sign(b"nonce")
