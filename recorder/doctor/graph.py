"""Looks at the graph for the doctor, as the recorder itself does."""

import time
from collections.abc import Mapping
from typing import Final

from recorder.config import RecorderSettings
from recorder.intake.intake import intake

DISCOVERY_S: Final = 3.0


def look(settings: RecorderSettings) -> tuple[tuple[str, ...], Mapping[str, str]]:
    """Returns the topics that can be recorded, and by topic why others can't, after discovery.

    Raises:
        UserError: ROS 2 can't be used.
    """
    with intake(settings.presets, lambda _items: None) as taking:
        taking.want(frozenset(settings.presets))
        time.sleep(DISCOVERY_S)  # Polled as well, an empty graph would take all of it.
        return taking.topics, taking.problems
