"""How often each topic is published."""

from collections.abc import Mapping

from simrobot.behaviour import Topic

DEFAULT_RATES_HZ: Mapping[Topic, float] = {
    Topic.ODOMETRY: 50.0,
    Topic.VISION: 10.0,
    Topic.DETECTIONS: 15.0,
    Topic.BATTERY: 1.0,
    Topic.DIAGNOSTICS: 1.0,
}
