"""Tokens: enough entropy, compared in constant time, and never shown by accident."""

import hmac
import inspect

import pytest

from gateway.access.token import Token, hash_of, new_id, new_token, parse_token, verify


def test_a_token_is_256_random_bits_and_reads_back() -> None:
    made = {new_token(new_id()) for _ in range(100)}
    assert len(made) == 100
    assert all(parse_token(each.text()) == each for each in made)
    # 43 characters of 6 bits each, of which the last carries 4.
    assert {len(each.secret) for each in made} == {43}


@pytest.mark.parametrize(
    "text",
    ["", "rgt-", "rgt-00.x", "rgt-00112233445Z." + "A" * 43, "rgt-001122334455." + "A" * 44, "x" * 9999],
)
def test_other_text_is_no_token(text: str) -> None:
    assert parse_token(text) is None


def test_only_the_right_secret_of_the_right_credential_matches() -> None:
    right = new_token(new_id())
    kept = hash_of(right)
    assert verify(right, kept)
    assert not verify(Token(right.credential_id, right.secret[:-1] + "_"), kept) or right.secret[-1] == "_"
    assert not verify(Token(new_id(), right.secret), kept)
    assert not verify(right, None)
    assert right.secret not in kept


def test_a_secret_is_in_no_repr() -> None:
    made = new_token(new_id())
    assert made.secret not in repr(made)


def test_every_comparison_goes_through_constant_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """For an unknown id, too: the time that it takes must not reveal which ids exist."""
    seen: list[tuple[str, str]] = []

    def compare(one: str, other: str) -> bool:
        seen.append((one, other))
        return one == other

    monkeypatch.setattr(hmac, "compare_digest", compare)
    made = new_token(new_id())
    verify(made, hash_of(made))
    verify(made, None)
    assert [len(one) == len(other) for one, other in seen] == [True, True]
    assert "==" not in inspect.getsource(verify)
