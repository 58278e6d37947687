"""The keys of the cockpit, in the order of the list that F1 shows."""

from collections.abc import Sequence
from functools import partial
from typing import Final, Protocol

from PySide6.QtWidgets import QWidget

from console.presentation.preview_switch import PROFILES
from console.window.arrangement import Arrangement
from console.window.driving import Driving
from console.window.keys import Key, full_screen_key
from console.window.practice_band import PracticeBand
from console.window.preview_actions import PreviewActions
from console.window.recording_actions import RecordingActions
from console.window.side_panel import TABS

KEYS_OF_THE_HANDS: Final = (
    Key(("Space",), "STOP, until it is reset (to type one: Shift+Space)", None),
    Key(("W A S D", "arrows"), "while driving: forward, turn, back", None),
    Key(("Q E",), "while driving: sideways, left and right", None),
)
"""`drive_hands.py` reads them, on a robot that can be driven."""
_PROFILES = ("low bandwidth", "balanced", "high quality")


class Cockpit(Protocol):
    """What the keys do, beside showing the window on the full screen and closing it."""

    preview_actions: PreviewActions
    recording: RecordingActions
    driving: Driving
    arrangement: Arrangement
    band: PracticeBand | None

    def acknowledge(self) -> None:
        """Acknowledges all alarms."""

    def retry(self) -> None:
        """Ends the pause before the next attempt to connect."""

    def toggle_boxes(self) -> None:
        """Shows or hides the boxes around objects."""

    def toggle_sound(self) -> None:
        """Turns the alarm's sound on or off."""

    def toggle_help(self) -> None:
        """Shows or hides the list of keys."""

    def show_tab(self, number: int) -> None:
        """Shows a tab of the side panel."""

    def show_robots(self) -> None:
        """Opens the list of robots."""

    def search_events(self) -> None:
        """Moves to the search for events."""

    def save_picture(self) -> None:
        """Saves the picture with its status."""

    def export_events(self) -> None:
        """Saves the listed events."""

    def escape(self) -> None:
        """Closes what lies over the picture."""


def cockpit_keys(cockpit: Cockpit, window: QWidget) -> Sequence[Key]:
    """Returns every key of the cockpit: each of its actions has one.

    Args:
        cockpit: has the actions.
        window: it is in.
    """
    preview, recording = cockpit.preview_actions, cockpit.recording
    driving, arrangement = cockpit.driving, cockpit.arrangement
    profiles = (
        Key((str(number),), f"preview: {title}", partial(preview.choose, profile))
        for number, (title, profile) in enumerate(zip(_PROFILES, PROFILES, strict=True), start=1)
    )
    tabs = (
        Key((f"Ctrl+{number}",), f"tab {title}", partial(cockpit.show_tab, number - 1))
        for number, title in enumerate(TABS, start=1)
    )
    practice = (Key(("N",), "practice: another network", cockpit.band.choose_next),) if cockpit.band else ()
    return (
        *practice,
        Key(("P",), "preview on or off", preview.switch),
        *profiles,
        Key(("V",), "preview: next camera", preview.next_camera),
        Key(("O",), "boxes around objects", cockpit.toggle_boxes),
        Key(("S",), "save the picture and its status", cockpit.save_picture),
        Key(("C",), "record, and stop recording", recording.record),
        Key(("K",), "keep the last seconds", recording.keep),
        Key(("T",), "drive, and end driving", driving.toggle),
        Key(("Shift+R",), "reset the stop that is shown", driving.reset),
        Key(("A",), "acknowledge all alarms", cockpit.acknowledge),
        Key(("M",), "alarm sound on or off", cockpit.toggle_sound),
        Key(("R",), "retry to connect now", cockpit.retry),
        Key(("F",), "picture only, and back", arrangement.toggle_picture_only),
        full_screen_key(window, "F11"),
        Key(("F9",), "side panel", arrangement.toggle_panel),
        *tabs,
        Key(("Ctrl+F",), "search in the events", cockpit.search_events),
        Key(("Ctrl+E",), "export the listed events", cockpit.export_events),
        Key(("Ctrl+R",), "another robot", cockpit.show_robots),
        Key(("Esc",), "close messages; back to the window", cockpit.escape),
        Key(("F1", "?"), "these keys", cockpit.toggle_help),
        Key(("Q",), "quit", window.close),
    )
