"""A signal is not forgotten, even where its exception is."""

import os
import signal
from collections.abc import Iterator
from contextlib import suppress

import pytest
from demo_program.interruption import SIGNALS, Interruption


@pytest.fixture(autouse=True)
def _handlers() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_interrupts_and_is_remembered(number: signal.Signals) -> None:
    interruption = Interruption()
    interruption.raise_if_asked()
    # As a C library does that clears whatever was raised in the Python it called.
    with suppress(KeyboardInterrupt):
        os.kill(os.getpid(), number)
    with pytest.raises(KeyboardInterrupt):
        interruption.raise_if_asked()


def test_what_the_shell_has_us_ignore_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    interruption = Interruption()
    os.kill(os.getpid(), signal.SIGINT)
    interruption.raise_if_asked()


@pytest.mark.parametrize("number", SIGNALS)
def test_a_deferred_signal_interrupts_at_the_end_of_the_block(number: signal.Signals) -> None:
    interruption = Interruption()
    seen = []

    def work() -> None:
        with interruption.deferred():
            os.kill(os.getpid(), number)
            seen.append("undisturbed")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert seen == ["undisturbed"]
