"""Which results of trials are kept, and when a trial is repeated."""

import asyncio

import pytest

from common.trial import TrialError
from preview.encoders.catalogue import CATALOGUE, Encoder
from preview.encoders.probe import FIRST_RETRY_S, LONGEST_RETRY_S, TrialProber, Verdict
from preview.encoders.selection import Selection
from tests.support.virtual_time import in_virtual_time

MPP, X264 = CATALOGUE["mpp-h265"], CATALOGUE["x264"]
PROVEN = Verdict(present=True, proven=True, first_byte_ms=5)
TIMED_OUT = TrialError("it hung: no result within 6 s", passing=True)
REFUSED = TrialError("it crashed when tried (SIGSEGV)")


class Trials:
    """Counts trials; `outcome` is that of the next one of MPP, the others succeed."""

    def __init__(self, outcome: Verdict | Exception, trial_s: float = 0.0) -> None:
        self.outcome = outcome
        self.at_s: list[float] = []
        self._trial_s = trial_s

    async def __call__(self, encoder: Encoder) -> Verdict:
        if encoder is not MPP:
            return PROVEN
        self.at_s.append(asyncio.get_running_loop().time())
        await asyncio.sleep(self._trial_s)
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


@pytest.mark.parametrize("outcome", [PROVEN, REFUSED])
@in_virtual_time
async def test_a_definite_result_is_kept(outcome: Verdict | TrialError) -> None:
    trials = Trials(outcome)
    prober = TrialProber(trials)
    first = await prober.verdict(MPP)
    await asyncio.sleep(10_000)
    assert await prober.verdict(MPP) is first
    assert first.proven is (outcome is PROVEN)
    assert first.reason == ("" if first.proven else str(outcome))
    assert len(trials.at_s) == 1


@in_virtual_time
async def test_a_defect_in_a_trial_is_a_result_and_the_next_encoder_is_used(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The defect: all that waited for the trial did so for ever, and the preview did not start."""
    encoders = Selection([MPP, X264], 600, TrialProber(Trials(KeyError("first_byte_ms"))))
    async with asyncio.timeout(1):
        assert await encoders.probe()
    chosen, choice = encoders.choose()
    assert chosen is X264
    assert choice.fallback_reason == "its trial failed: KeyError: 'first_byte_ms'"
    assert "the trial of mpp-h265 failed" in caplog.text
    assert "Traceback" in caplog.text


@in_virtual_time
async def test_after_a_busy_boot_the_hardware_is_used_without_a_restart() -> None:
    trials = Trials(TIMED_OUT)
    prober = TrialProber(trials)
    encoders = Selection([MPP, X264], 600, prober)
    assert await encoders.probe()
    chosen, choice = encoders.choose()
    assert chosen is X264
    assert choice.fallback_reason.startswith("it hung: no result within 6 s (tried again after 10 s")
    trials.outcome = PROVEN
    await asyncio.sleep(FIRST_RETRY_S + 1)
    assert await encoders.probe()
    assert encoders.choose()[0] is MPP
    await asyncio.sleep(10_000)
    assert len(trials.at_s) == 2
    await prober.close()


@in_virtual_time
async def test_the_pauses_grow_and_are_bounded() -> None:
    trials = Trials(TIMED_OUT)
    prober = TrialProber(trials)
    await prober.verdict(MPP)
    await asyncio.sleep(4000)
    pauses_s = [later - earlier for earlier, later in zip(trials.at_s, trials.at_s[1:], strict=False)]
    assert pauses_s[:3] == [FIRST_RETRY_S, 2 * FIRST_RETRY_S, 4 * FIRST_RETRY_S]
    assert pauses_s[-1] == LONGEST_RETRY_S
    assert "tried again after 600 s" in (await prober.verdict(MPP)).reason
    await prober.close()
    await asyncio.sleep(4000)
    assert len(trials.at_s) == len(pauses_s) + 1


@in_virtual_time
async def test_without_repetition_every_result_is_final() -> None:
    trials = Trials(TIMED_OUT)
    prober = TrialProber(trials, repeats=False)
    assert (await prober.verdict(MPP)).reason == str(TIMED_OUT)
    await asyncio.sleep(10_000)
    assert len(trials.at_s) == 1


@in_virtual_time
async def test_a_repeated_trial_does_not_delay_a_start() -> None:
    prober = TrialProber(Trials(TIMED_OUT, trial_s=6))
    await prober.verdict(MPP)
    await asyncio.sleep(FIRST_RETRY_S + 1)
    before_s = asyncio.get_running_loop().time()
    assert not (await prober.verdict(MPP)).proven
    assert asyncio.get_running_loop().time() == before_s
    await prober.close()


@in_virtual_time
async def test_a_cancelled_caller_does_not_cancel_the_trial_of_others() -> None:
    prober = TrialProber(Trials(PROVEN, trial_s=2))
    one, other = (asyncio.create_task(prober.verdict(MPP)) for _ in range(2))
    await asyncio.sleep(1)
    one.cancel()
    assert await other is PROVEN


@in_virtual_time
async def test_closed_no_caller_waits_any_longer() -> None:
    prober = TrialProber(Trials(PROVEN, trial_s=2))
    caller = asyncio.create_task(prober.verdict(MPP))
    await asyncio.sleep(1)
    await prober.close()
    with pytest.raises(asyncio.CancelledError):
        await caller
