"""Which encoder is used, and what is said about it."""

from preview.encoders.catalogue import CATALOGUE
from preview.encoders.selection import Selection, Verdict

ORDER = [CATALOGUE[name] for name in ("mpp-h265", "va-h265", "x264")]
GOOD = Verdict(present=True, proven=True, first_byte_ms=5)
BAD = Verdict(present=True, proven=False, reason="it gave no output")
ABSENT = Verdict(present=False, proven=False, reason="there is no GStreamer element mpph265enc")


def chosen(selection: Selection, verdicts: dict[str, Verdict], now: float = 0) -> tuple[str, str]:
    found = selection.choose(verdicts, now)
    assert found is not None
    encoder, choice = found
    assert choice.name == encoder.name
    assert choice.wanted == "mpp-h265"
    assert (choice.codec, choice.hardware) == (encoder.codec, encoder.hardware)
    return choice.name, choice.fallback_reason


def test_the_first_proven_one_wins() -> None:
    everything = {"mpp-h265": GOOD, "va-h265": GOOD, "x264": GOOD}
    assert chosen(Selection(ORDER, 600), everything) == ("mpp-h265", "")
    assert chosen(Selection(ORDER, 600), everything | {"mpp-h265": BAD}) == ("va-h265", "it gave no output")
    assert chosen(Selection(ORDER, 600), everything | {"mpp-h265": ABSENT}) == ("va-h265", ABSENT.reason)


def test_one_that_failed_is_passed_over_until_it_is_forgiven() -> None:
    selection = Selection(ORDER, 600)
    verdicts = {"mpp-h265": GOOD, "va-h265": GOOD, "x264": GOOD}
    selection.pass_over("mpp-h265", "encoder mpp-h265 failed: oh", now=100)
    assert chosen(selection, verdicts, now=101) == ("va-h265", "encoder mpp-h265 failed: oh")
    assert chosen(selection, verdicts, now=699) == ("va-h265", "encoder mpp-h265 failed: oh")
    assert chosen(selection, verdicts, now=701) == ("mpp-h265", "")


def test_when_all_have_failed_all_are_forgiven() -> None:
    selection = Selection(ORDER, 600)
    verdicts = {"mpp-h265": GOOD, "va-h265": BAD, "x264": GOOD}
    selection.pass_over("mpp-h265", "one", now=0)
    assert selection.has_another(verdicts)
    selection.pass_over("x264", "two", now=1)
    assert not selection.has_another(verdicts)
    assert chosen(selection, verdicts, now=2) == ("mpp-h265", "")


def test_none_proven_says_what_was_tried() -> None:
    selection = Selection(ORDER, 600)
    assert selection.choose({"mpp-h265": ABSENT, "va-h265": BAD}, 0) is None
    text = selection.why_none({"mpp-h265": ABSENT, "va-h265": BAD})
    assert "va-h265: it gave no output" in text
    assert "mpp-h265: " not in text
    assert "none of their GStreamer elements is installed" in selection.why_none({})


def test_what_was_not_tried_is_not_used() -> None:
    assert chosen(Selection(ORDER, 600), {"x264": GOOD}) == ("x264", "mpp-h265 was not tried")
