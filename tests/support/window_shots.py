"""One screenshot of a real window: `python -m tests.support.window_shots SITUATION WIDTH HEIGHT SCALE FILE`.

A process of its own, because Qt reads the size and scale of the (virtual) screen once, at its start. Prints
one JSON object: what of the window fits the screen, and how much of it is the picture.
"""

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

_SITUATIONS: Final = (
    "cockpit",
    "panel-closed",
    "trouble",
    "driving",
    "tiles",
    "tiles-driving",
    "recording",
    "dark",
    "view",
    "view-maximised",
)
_FRAMES: Final = 5
_HISTORY_S: Final = 4.0
"""Until the trail is visible, and the plots have a curve."""
_WITH_HISTORY: Final = frozenset({"cockpit", "trouble", "dark"})
"""Situations that are shown with them: what is seen of the others is there at once."""


def _choose_screen(width: int, height: int, scale: int, directory: Path) -> None:
    """Describes the screen to Qt, in pixels; before Qt is imported."""
    screen = {
        "name": "desk",
        "x": 0,
        "y": 0,
        "width": width,
        "height": height,
        "logicalDpi": 96,
        "logicalBaseDpi": 96,
        "dpr": 1,
    }
    file = directory / "screen.json"
    form = {"synchronousWindowSystemEvents": False, "windowFrameMargins": False, "screens": [screen]}
    file.write_text(json.dumps(form), encoding="utf-8")
    os.environ["QT_QPA_PLATFORM"] = f"offscreen:configfile={file}"
    os.environ["QT_SCALE_FACTOR"] = str(scale)
    os.environ["XDG_CONFIG_HOME"] = os.environ["XDG_CACHE_HOME"] = str(directory)


def main() -> None:
    """Takes the screenshot."""
    situation, width, height, scale, file = sys.argv[1], *map(int, sys.argv[2:5]), Path(sys.argv[5])
    assert situation in _SITUATIONS, situation
    with tempfile.TemporaryDirectory() as name:
        _choose_screen(width, height, scale, Path(name))
        # Imported here: the modules import Qt.
        from tests.support.qt import DARK, LIGHT, in_colours  # noqa: PLC0415

        from PySide6.QtWidgets import QApplication  # noqa: PLC0415 # isort: skip

        application = QApplication(["window-shots"])
        application.setStyle("Fusion")
        in_colours(DARK if situation == "dark" else LIGHT)
        take = _view if situation.startswith("view") else _cockpit
        found = take(situation, Path(name), file)
    print(json.dumps(found))


def _cockpit(situation: str, directory: Path, file: Path) -> Mapping[str, Any]:
    from console.window.programs import monitor  # noqa: PLC0415
    from console.window.side_panel import TABS  # noqa: PLC0415
    from tests.support.cockpit import seeing_robot, with_recorder, with_teleop, with_tiles, with_trouble  # noqa: PLC0415
    from tests.support.qt import let_pass, until  # noqa: PLC0415

    with seeing_robot(directory) as robot, monitor(robot.target) as window, _frames(window.video) as frames:
        until(lambda: frames() >= _FRAMES, "the picture")
        if situation in _WITH_HISTORY:
            let_pass(_HISTORY_S)
        if situation == "trouble":
            with_trouble(robot.gateway)
        if situation in ("trouble", "driving", "tiles-driving"):
            with_teleop(robot.gateway)
        if situation in ("tiles", "tiles-driving"):
            with_tiles(robot.gateway)
            until(lambda: not window.picture.values.isHidden(), "the tiles")
        if situation == "recording":
            with_recorder(robot.gateway)
            until(lambda: not window.recording.absent, "the recorder")
            window.show_tab(TABS.index("Recordings"))
        if situation == "panel-closed":
            window.arrangement.toggle_panel()
        let_pass(1.0)
        return {**_look(window, file), "maximised": window.isMaximized()}


def _view(situation: str, directory: Path, file: Path) -> Mapping[str, Any]:
    from console.viewer.summary import FrameCounter  # noqa: PLC0415
    from console.window.programs import viewing  # noqa: PLC0415
    from tests.support.cockpit import seeing_robot  # noqa: PLC0415
    from tests.support.qt import let_pass, until  # noqa: PLC0415

    with (
        seeing_robot(directory) as robot,
        viewing(robot.target, None, FrameCounter()) as window,
        _frames(window.video) as frames,
    ):
        if situation == "view-maximised":
            window.showMaximized()
        until(lambda: frames() >= _FRAMES, "the picture")
        let_pass(1.5)
        return {**_look(window, file), "maximised": window.isMaximized()}


@contextmanager
def _frames(video: Any) -> Iterator[Callable[[], int]]:
    painted: list[None] = []
    connection = video.painted.connect(lambda: painted.append(None))
    yield lambda: len(painted)
    video.painted.disconnect(connection)


def _look(window: Any, file: Path) -> Mapping[str, Any]:
    image, screen = window.grab().toImage(), window.screen().availableSize()
    file.parent.mkdir(parents=True, exist_ok=True)
    assert image.save(str(file), "PNG", 0), f"{file} can't be written"
    box, least = window.video.frame_box(), window.minimumSizeHint()
    return {
        "pixels": [image.width(), image.height()],
        "screen": [screen.width(), screen.height()],
        "window": [window.width(), window.height()],
        "least": [least.width(), least.height()],
        "picture_share": box.width * box.height / (window.width() * window.height()),
    }


if __name__ == "__main__":
    main()
