"""JetStream's answers: a repeat and a full stream have one error code; the sentence distinguishes them."""

import pytest

from fleet.errors import HubReason, api_error, is_repeat


@pytest.mark.parametrize(
    ("code", "text", "reason", "repeat"),
    [
        (10077, "maximum messages per subject exceeded", HubReason.INVALID, True),
        (10077, "maximum bytes exceeded", HubReason.FULL, False),
        (10077, "maximum messages exceeded", HubReason.FULL, False),
        (10077, "something new", HubReason.INVALID, False),
        (10008, "JetStream system temporarily unavailable", HubReason.NO_QUORUM, False),
        (10054, "message size exceeds maximum allowed", HubReason.TOO_LARGE, False),
        (10059, "stream not found", HubReason.MISSING, False),
        (1, "maximum messages per subject exceeded", HubReason.INVALID, False),
    ],
)
def test_the_sentence_decides(code: int, text: str, reason: HubReason, repeat: bool) -> None:
    error = api_error({"code": 400, "err_code": code, "description": text})
    assert (error.reason, is_repeat(error), error.code) == (reason, repeat, code)


@pytest.mark.parametrize("error", [None, 7, "no", [], {"err_code": "10077"}, {"description": 3}, {}])
def test_an_error_may_be_anything(error: object) -> None:
    assert not is_repeat(api_error(error))


def test_an_unknown_error_with_503_may_pass() -> None:
    assert api_error({"code": 503, "err_code": 99999}).reason is HubReason.NO_QUORUM


def test_long_sentences_are_cut() -> None:
    assert len(str(api_error({"description": "x" * 10_000}))) < 300
