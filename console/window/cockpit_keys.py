"""The keys of the cockpit, in the order of the list that F1 shows."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

from console.presentation.preview_switch import PROFILES
from console.window.keys import Key, full_screen_key
from console.window.side_panel import TABS

if TYPE_CHECKING:
    from console.window.monitor_window import MonitorWindow

KEYS_OF_THE_HANDS: Final = (
    Key(("Space",), "STOP, until it is reset (to type one: Shift+Space)", None),
    Key(("W A S D", "arrows"), "while driving: forward, turn, back", None),
    Key(("Q E",), "while driving: sideways, left and right", None),
)
"""`drive_hands.py` reads them, on a robot that can be driven."""
_PROFILES = ("low bandwidth", "balanced", "high quality")


def cockpit_keys(window: "MonitorWindow") -> Sequence[Key]:
    """Returns every key of the window: each of its actions has one."""
    profiles = (
        Key((str(number),), f"preview: {title}", partial(window.choose, profile))
        for number, (title, profile) in enumerate(zip(_PROFILES, PROFILES, strict=True), start=1)
    )
    tabs = (
        Key((f"Ctrl+{number}",), f"tab {title}", partial(window.show_tab, number - 1))
        for number, title in enumerate(TABS, start=1)
    )
    practice = (Key(("N",), "practice: another network", window.band.choose_next),) if window.band else ()
    return (
        *practice,
        Key(("P",), "preview on or off", window.switch),
        *profiles,
        Key(("V",), "preview: next camera", window.next_camera),
        Key(("O",), "boxes around objects", window.toggle_boxes),
        Key(("S",), "save the picture and its status", window.save_picture),
        Key(("C",), "record, and stop recording", window.recording.record),
        Key(("K",), "keep the last seconds", window.recording.keep),
        Key(("T",), "drive, and end driving", window.driving.toggle),
        Key(("Shift+R",), "reset the stop that is shown", window.driving.reset),
        Key(("A",), "acknowledge all faults", window.acknowledge),
        Key(("M",), "alarm sound on or off", window.toggle_sound),
        Key(("R",), "retry to connect now", window.retry),
        Key(("F",), "picture only, and back", window.toggle_picture_only),
        full_screen_key(window, "F11"),
        Key(("F9",), "side panel", window.toggle_panel),
        *tabs,
        Key(("Ctrl+F",), "search in the events", window.search_events),
        Key(("Ctrl+E",), "export the listed events", window.export_events),
        Key(("Ctrl+R",), "another robot", window.show_robots),
        Key(("Esc",), "close messages; back to the window", window.escape),
        Key(("F1", "?"), "these keys", window.toggle_help),
        Key(("Q",), "quit", window.close),
    )
