"""What ends `robot-drive doctor` in order, so that a pulse that is under way ends with zeros."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from common.findings import Finding
from drive import cli

IN_ORDER = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)


@pytest.fixture(autouse=True)
def _handlers() -> Iterator[None]:
    """Has a signal that the doctor does not take fail the test, and not end the run."""
    before = {number: signal.signal(number, lambda *_: None) for number in IN_ORDER}
    # As Python starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@pytest.mark.parametrize("number", IN_ORDER, ids=lambda each: each.name)
def test_each_interrupts_the_doctor_where_it_is(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """tests/integration/drive/test_pulse.py sends one of them to a doctor whose pulse moves a robot."""
    interrupted: list[signal.Signals] = []

    def examine(_config: Path | None, *, with_pulse: bool) -> Iterator[Finding]:
        assert with_pulse
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        interrupted.append(number)
        return iter(())

    monkeypatch.setattr("drive.doctor.examination.examine", examine)
    with pytest.raises(typer.Exit):
        cli.doctor(pulse=True, as_json=True)
    assert interrupted == [number]
