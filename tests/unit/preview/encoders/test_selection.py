"""Which encoder is chosen, and the reason that is reported."""

import pytest

from common.errors import UserError
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.encoders.probe import TrialProber, Verdict
from preview.encoders.selection import Selection
from tests.support.clock import Clock

ORDER = [CATALOGUE[name] for name in ("mpp-h265", "va-h265", "x264")]
GOOD = Verdict(present=True, proven=True, first_byte_ms=5)
BAD = Verdict(present=True, proven=False, reason="it produced no output")
ABSENT = Verdict(present=False, proven=False, reason="there is no GStreamer element mpph265enc")
ALL_GOOD = {"mpp-h265": GOOD, "va-h265": GOOD, "x264": GOOD}


def prober(results: dict[str, Verdict]) -> TrialProber:
    """Trials with these results."""

    async def attempt(encoder: Encoder) -> Verdict:
        return results[encoder.name]

    return TrialProber(attempt)


def selection(verdicts: dict[str, Verdict], clock: Clock | None = None) -> Selection:
    """A selection whose trials have ended."""
    tried = prober(verdicts)
    tried.verdicts.update(verdicts)
    return Selection(ORDER, 600, tried, clock or Clock())


def chosen(selection: Selection) -> tuple[str, str]:
    encoder, choice = selection.choose()
    assert choice.name == encoder.name
    assert choice.wanted == "mpp-h265"
    assert choice.hardware == encoder.hardware
    return choice.name, choice.fallback_reason


def test_the_first_proven_one_wins() -> None:
    assert chosen(selection(ALL_GOOD)) == ("mpp-h265", "")
    assert chosen(selection(ALL_GOOD | {"mpp-h265": BAD})) == ("va-h265", "it produced no output")
    assert chosen(selection(ALL_GOOD | {"mpp-h265": ABSENT})) == ("va-h265", ABSENT.reason)


def test_one_that_failed_is_passed_over_until_it_is_forgiven() -> None:
    clock = Clock()
    encoders = selection(ALL_GOOD, clock)
    clock.now_s = 100
    encoders.pass_over("mpp-h265", "encoder mpp-h265 failed: oh")
    for clock.now_s in (101, 699):
        assert chosen(encoders) == ("va-h265", "encoder mpp-h265 failed: oh")
    clock.now_s = 701
    assert chosen(encoders) == ("mpp-h265", "")


async def test_one_that_is_passed_over_is_tried_last() -> None:
    """After a crash the stream waits for the trial of the encoder that takes over, for no other."""
    clock, tried = Clock(), prober(ALL_GOOD)
    encoders = Selection(ORDER, 600, tried, clock)
    encoders.pass_over("mpp-h265", "it crashed")
    assert await encoders.probe()
    assert list(tried.verdicts) == ["va-h265"]
    assert [encoder.name for encoder in encoders.order_of_trials] == ["va-h265", "x264", "mpp-h265"]
    clock.now_s += 601
    assert encoders.order_of_trials == ORDER


async def test_what_the_previous_process_proved_needs_no_trial() -> None:
    tried: list[str] = []

    async def attempt(encoder: Encoder) -> Verdict:
        tried.append(encoder.name)
        return GOOD

    encoders = Selection(ORDER, 600, TrialProber(attempt), Clock())
    encoders.pass_over("mpp-h265", "it crashed")
    encoders.trust({"x264", "unknown"})
    assert encoders.proven == ["x264"]
    assert await encoders.probe()
    assert tried == []


async def test_when_all_have_failed_all_are_forgiven() -> None:
    encoders = selection({"mpp-h265": GOOD, "va-h265": BAD, "x264": GOOD})
    encoders.pass_over("mpp-h265", "one")
    assert await encoders.probe()
    encoders.pass_over("x264", "two")
    assert not await encoders.probe()
    assert chosen(encoders) == ("mpp-h265", "")


def test_none_proven_lists_what_was_tried() -> None:
    with pytest.raises(UserError, match="va-h265: it produced no output") as refusal:
        selection({"mpp-h265": ABSENT, "va-h265": BAD}).choose()
    assert "mpp-h265: " not in str(refusal.value)
    assert "'robot-preview encoders' lists what works" in str(refusal.value)
    with pytest.raises(UserError, match="none of their GStreamer elements is installed"):
        selection({}).choose()


def test_what_was_not_tried_is_not_used() -> None:
    assert chosen(selection({"x264": GOOD})) == ("x264", "mpp-h265 was not tried")


async def test_trials_end_at_the_first_encoder_that_works_and_has_not_failed() -> None:
    trials = prober({"mpp-h265": BAD, "va-h265": GOOD, "x264": GOOD})
    encoders = Selection(ORDER, 600, trials)
    assert await encoders.probe()
    assert set(trials.verdicts) == {"mpp-h265", "va-h265"}
    encoders.pass_over("va-h265", "it failed")
    assert await encoders.probe()
    assert set(trials.verdicts) == {"mpp-h265", "va-h265", "x264"}
