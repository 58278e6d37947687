"""The list of credentials: reads back what it writes, takes nothing else, and has an end."""

import json

import pytest

from common.errors import UserError
from gateway.access.credential import Credential, Kind
from gateway.access.role import Role
from gateway.access.store import MOST, Store, check_name, parse_store, store_text

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
    store = Store().with_one_more(ONE).with_one_more(numbered(1, revoked_s=9))
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
def test_a_credential_that_is_not_in_order_makes_the_list_none(key: str, value: object) -> None:
    document = json.loads(store_text(Store().with_one_more(ONE)))
    document["credentials"][0][key] = value
    with pytest.raises(ValueError, match="credential 1 is not in order"):
        parse_store(json.dumps(document))


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", "null", '{"version": 2, "credentials": []}', '{"version": 1}', "[" * 100_000, "\x00"],
)
def test_what_is_no_list_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        parse_store(text)


def test_two_of_one_id_are_refused() -> None:
    document = json.loads(store_text(Store().with_one_more(ONE)))
    document["credentials"] *= 2
    with pytest.raises(ValueError, match="same id"):
        parse_store(json.dumps(document))


def test_what_is_over_for_longest_makes_room_and_nothing_else_does() -> None:
    store = Store()
    for number in range(MOST):
        store = store.with_one_more(numbered(number))
    with pytest.raises(UserError, match="Revoke some"):
        store.with_one_more(numbered(MOST))
    later, earlier = store.credentials[f"{7:012x}"], store.credentials[f"{9:012x}"]
    store = store.revoked([later], 20).revoked([earlier], 10).with_one_more(numbered(MOST))
    assert len(store.credentials) == MOST
    assert earlier.credential_id not in store.credentials
    assert later.credential_id in store.credentials


def test_a_name_means_all_of_that_name_that_are_not_over() -> None:
    store = Store()
    for number, over in enumerate((None, None, 5)):
        store = store.with_one_more(numbered(number, name="anna", revoked_s=over))
    assert [each.made_s for each in store.found("anna", 100)] == [0, 1]
    assert [each.made_s for each in store.found(f"{1:012x}", 100)] == [1]
    for nobody in ("ben", f"{2:012x}"):
        with pytest.raises(UserError, match="no credential in force"):
            store.found(nobody, 100)


def test_an_end_comes_no_later_than_it_would_have() -> None:
    store = Store().with_one_more(numbered(1, ends_s=50)).with_one_more(numbered(2))
    ended = store.ending(store.credentials.values(), 80)
    assert [each.ends_s for each in ended.credentials.values()] == [50, 80]


@pytest.mark.parametrize("name", ["", "a b", "../x", "-x", "a" * 64, "a\x1b[0m", "ä"])
def test_names_that_could_be_mistaken_are_refused(name: str) -> None:
    with pytest.raises(UserError, match="can't be the name"):
        check_name(name)
