"""Mistakes in the behaviour: what is there, what is expected, what was probably meant."""

import pytest

from common.errors import ExitCode, UserError
from simrobot.behaviour import Behaviour


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"speed_mps": "x"}, "field 'speed_mps' is 'x', expected: a number, 2.5 for example"),
        ({"speed_mps": "inf"}, "field 'speed_mps' is 'inf', expected: a finite number, 2.5 for example"),
        ({"spedmps": 1}, "unknown field 'spedmps'. Did you mean 'speed_mps'? Allowed: silent, "),
        ({"silent": "odometry"}, "field 'silent' is 'odometry', expected: a list, [a, b] for example"),
        ({"silent": ["odom"]}, "effective_command; did you mean odometry?"),
        (
            {"components": {"drve": "ok"}},
            "is 'drve', expected: one of drive, battery, vision, lidar; did you ",
        ),
        (
            {"components": {"drive": "eror"}},
            "expected: one of ok, warning, error, stale; did you mean error?",
        ),
        ({"commander": "joystick"}, "expected: one of keyboard, autonomy, navigation, unseen, nobody"),
        ({"detection_count": -1}, "field 'detection_count' is -1, expected: at least 0"),
    ],
)
def test_a_mistake(fields: dict[str, object], sentence: str) -> None:
    with pytest.raises(UserError) as raised:
        Behaviour().changed(fields)
    assert raised.value.what.startswith("behaviour: ")
    assert sentence in raised.value.what
    assert raised.value.exit_code is ExitCode.USAGE
