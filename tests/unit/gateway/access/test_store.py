"""The list of credentials: reads back what it writes, takes nothing else, and is bounded."""

import json

import pytest

from common.errors import UserError
from gateway.access.credential import Credential, Kind
from gateway.access.role import Role
from gateway.access.store import MAX_CREDENTIALS, Store, check_name, parse_store, store_text

ONE = Credential("a" * 12, "anna", Role.ADMIN, Kind.TOKEN, "0" * 64, 1, 2, 3, None)


def numbered(number: int, **changed: object) -> Credential:
    values: dict[str, object] = {
        "credential_id": f"{number:012x}",
        "name": f"person-{number}",
        "role": Role.VIEWER,
        "kind": Kind.TOKEN,
        "proof": "0" * 64,
        "made_s": number,
    }
    return Credential(**values | changed)  # type: ignore[arg-type]  # a test's short hand


def test_what_is_written_reads_back() -> None:
    store = Store().adding(ONE).adding(numbered(1, revoked_s=9))
    assert parse_store(store_text(store)) == store


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("id", "../../etc"),
        ("id", 7),
        ("name", "a\nb"),
        ("role", "root"),
        ("kind", "password"),
        ("proof", "x"),
        ("ends", "tomorrow"),
        ("ends", True),
        ("made", -1),
        ("more", 1),
    ],
)
def test_one_invalid_credential_makes_the_list_invalid(key: str, value: object) -> None:
    document = json.loads(store_text(Store().adding(ONE)))
    document["credentials"][0][key] = value
    with pytest.raises(ValueError, match="credential 1 is invalid"):
        parse_store(json.dumps(document))


@pytest.mark.parametrize("key", ["id", "made", "begins", "ends", "revoked"])
def test_every_key_is_required(key: str) -> None:
    document = json.loads(store_text(Store().adding(ONE)))
    del document["credentials"][0][key]
    with pytest.raises(ValueError, match="credential 1 is invalid"):
        parse_store(json.dumps(document))


def test_an_error_quotes_nothing_of_the_list() -> None:
    document = json.loads(store_text(Store().adding(ONE)))
    document["credentials"][0]["secret-key"] = "secret-value"
    with pytest.raises(ValueError, match="invalid") as caught:
        parse_store(json.dumps(document))
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", "null", '{"version": 2, "credentials": []}', '{"version": 1}', "[" * 100_000, "\x00"],
)
def test_what_is_no_list_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        parse_store(text)


def test_two_of_one_id_are_refused() -> None:
    document = json.loads(store_text(Store().adding(ONE)))
    document["credentials"] *= 2
    with pytest.raises(ValueError, match="same id"):
        parse_store(json.dumps(document))


def test_the_credential_revoked_first_makes_room_and_no_other() -> None:
    store = Store()
    for number in range(MAX_CREDENTIALS):
        store = store.adding(numbered(number))
    with pytest.raises(UserError, match="Revoke some"):
        store.adding(numbered(MAX_CREDENTIALS))
    later, earlier = store.credentials[f"{7:012x}"], store.credentials[f"{9:012x}"]
    store = store.revoking([later], 20).revoking([earlier], 10).adding(numbered(MAX_CREDENTIALS))
    assert len(store.credentials) == MAX_CREDENTIALS
    assert earlier.credential_id not in store.credentials
    assert later.credential_id in store.credentials


def test_a_name_finds_all_of_that_name_that_are_not_revoked() -> None:
    store = Store()
    for number, revoked_s in enumerate((None, None, 5)):
        store = store.adding(numbered(number, name="anna", revoked_s=revoked_s))
    assert [each.made_s for each in store.find("anna", 100)] == [0, 1]
    assert [each.made_s for each in store.find(f"{1:012x}", 100)] == [1]
    for unknown in ("ben", f"{2:012x}"):
        with pytest.raises(UserError, match="no valid credential"):
            store.find(unknown, 100)


def test_changes_name_each_credential_and_no_secret() -> None:
    before = Store().adding(ONE).adding(numbered(1)).adding(numbered(2))
    after = before.revoking([ONE], 9).expiring([numbered(1)], 99).adding(numbered(3))
    assert list(after.changes_since(before)) == [
        f"revoked anna (admin, {ONE.credential_id})",
        "changed person-1 (viewer, 000000000001)",
        "added person-3 (viewer, 000000000003)",
    ]
    assert list(before.changes_since(after)) == [
        f"changed anna (admin, {ONE.credential_id})",
        "changed person-1 (viewer, 000000000001)",
        "dropped person-3 (viewer, 000000000003)",
    ]
    assert ONE.proof not in str(ONE)


def test_an_earlier_expiry_is_kept() -> None:
    store = Store().adding(numbered(1, ends_s=50)).adding(numbered(2))
    ended = store.expiring(store.credentials.values(), 80)
    assert [each.ends_s for each in ended.credentials.values()] == [50, 80]


@pytest.mark.parametrize("name", ["", "a b", "../x", "-x", "a" * 64, "a\x1b[0m", "ä"])
def test_names_that_could_be_mistaken_are_refused(name: str) -> None:
    with pytest.raises(UserError, match="can't be the name"):
        check_name(name)
