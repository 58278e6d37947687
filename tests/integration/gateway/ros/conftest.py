"""Every test here has a ROS domain of its own."""

from tests.support.talker import talker

__all__ = ["talker"]
