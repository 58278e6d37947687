"""What robotctl drive says of what steers."""

import pytest

from console.cli.drive_input import Controls, Input
from console.cli.drive_keys import Hands, Liveness

KNOWN = Hands(releases=False, liveness=Liveness(0.0))
UNKNOWN = Hands(releases=False)


@pytest.mark.parametrize("choice", [Input.AUTO, Input.KEYBOARD])
def test_it_warns_where_presses_of_any_age_count(choice: Input) -> None:
    controls = Controls(choice, None)
    assert controls.warning(UNKNOWN).startswith("old presses count: this terminal does not answer")
    assert controls.warning(KNOWN) == ""
    assert controls.advice().startswith("hold w a s d to drive")


def test_it_says_nothing_of_keys_that_do_not_steer() -> None:
    controls = Controls(Input.GAMEPAD, None)
    assert (controls.warning(UNKNOWN), controls.advice()) == ("", "plug a gamepad in")
