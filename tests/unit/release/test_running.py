"""Foreign programs: their output is the answer, or the reason."""

import sys

import pytest
from release_program.running import run

from common.errors import UserError


def test_the_output_of_a_program_is_returned() -> None:
    assert run("echo", "well", within_s=10) == "well\n"


@pytest.mark.parametrize(
    ("command", "within_s", "said"),
    [
        (("sh", "-c", "echo out; echo why >&2; exit 3"), 10, "sh failed with code 3: out / why. Type this"),
        (("no-such-program",), 10, "no-such-program is not installed. Type this"),
        (("sleep", "60"), 0.05, "sleep did not end within 0 s. Type this"),
    ],
)
def test_a_failure_is_one_line_with_reason_and_remedy(
    command: tuple[str, ...], within_s: float, said: str
) -> None:
    with pytest.raises(UserError) as raised:
        run(*command, within_s=within_s, remedy="Type this")
    assert str(raised.value) == said


def test_our_own_modules_are_out_of_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/made/up")
    assert (
        run(sys.executable, "-P", "-c", "import sys; print('/made/up' in sys.path)", within_s=20) == "False\n"
    )
