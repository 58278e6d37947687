"""How often each topic is published."""

from collections.abc import Mapping

from simrobot.behaviour import COMMANDS, Topic

COMMANDS_HZ = 20.0

DEFAULT_RATES_HZ: Mapping[Topic, float] = {
    Topic.ODOMETRY: 50.0,
    Topic.VISION: 10.0,
    Topic.DETECTIONS: 15.0,
    Topic.BATTERY: 1.0,
    Topic.DIAGNOSTICS: 1.0,
    Topic.MODE: 5.0,
    **dict.fromkeys(COMMANDS, COMMANDS_HZ),
}
"""Mode and commands are only published when there is something to tell: this often it is looked."""
