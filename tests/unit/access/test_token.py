"""Tokens: enough chance, compared in constant time, and never shown by accident."""

import inspect

import pytest

from gateway.access import token
from gateway.access.token import Token, hash_of, is_token, new_id, new_token, parse_token


def test_a_token_is_256_bits_of_chance_and_reads_back() -> None:
    made = {new_token(new_id()) for _ in range(100)}
    assert len(made) == 100
    assert all(parse_token(each.text()) == each for each in made)
    # 43 characters of 6 bits each, of which the last carries 4.
    assert {len(each.secret) for each in made} == {43}


@pytest.mark.parametrize(
    "text",
    ["", "rgt-", "rgt-00.x", "rgt-00112233445Z." + "A" * 43, "rgt-001122334455." + "A" * 44, "x" * 9999],
)
def test_what_is_no_token_is_none(text: str) -> None:
    assert parse_token(text) is None


def test_only_the_right_secret_of_the_right_credential_matches() -> None:
    right = new_token(new_id())
    kept = hash_of(right)
    assert is_token(right, kept)
    assert not is_token(Token(right.credential_id, right.secret[:-1] + "_"), kept) or right.secret[-1] == "_"
    assert not is_token(Token(new_id(), right.secret), kept)
    assert not is_token(right, None)
    assert right.secret not in kept


def test_a_secret_is_in_no_repr() -> None:
    made = new_token(new_id())
    assert made.secret not in repr(made)


def test_every_comparison_goes_through_constant_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """For an id that nobody has as well: how long it takes tells nobody which ids there are."""
    seen: list[tuple[str, str]] = []

    def compare(one: str, other: str) -> bool:
        seen.append((one, other))
        return one == other

    monkeypatch.setattr(token.hmac, "compare_digest", compare)
    made = new_token(new_id())
    is_token(made, hash_of(made))
    is_token(made, None)
    assert [len(one) == len(other) for one, other in seen] == [True, True]
    assert "==" not in inspect.getsource(is_token)
