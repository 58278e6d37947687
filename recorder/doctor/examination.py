"""`robot-recorder doctor`: the configuration, the disk, the running program, the graph."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import grpc

from common.config_finding import checked_settings
from common.errors import UserError
from common.findings import Finding, good, note, wrong
from common.ros_transport_findings import transport_finding
from common.start_command import is_supervised, start_command
from recorder.config import RecorderSettings
from recorder.doctor.judgement import (
    bundle_findings,
    folder_findings,
    preset_findings,
    program_findings,
)
from recorder.rpc.client import newest_state
from recorder.store.room import Limits, disk_of, used_bytes

_HIDDEN: Final = tuple(map(Path, ("/home", "/root", "/run/user", "/tmp", "/var/tmp")))  # noqa: S108
"""Folders of which a unit has none, or its own: systemd.exec(5), "ProtectHome" and "PrivateTmp"."""


def examine(config_file: Path | None) -> Iterator[Finding]:
    """Yields the findings on this machine.

    Args:
        config_file: of the program.
    """
    settings = yield from checked_settings(RecorderSettings, config_file, "robot-recorder")
    if settings is None:
        return
    yield from _folder(settings)
    for each in settings.run_bundles:
        problem = _unreadable(each)
        yield from bundle_findings(each, problem, None if problem else _hidden_below(each))
    try:
        yield from program_findings(newest_state(settings.socket))
    except grpc.RpcError as error:
        yield note(
            "recorder",
            f"no recorder answers at {settings.socket}: {error.code().name}",
            "Nothing is recorded",
            f"Start it: {start_command('robot-recorder')}",
        )
    if (tap := settings.video.socket) is None:
        yield note(
            "video", "video.socket is not set", "Recordings have no video", "docs/recording.md says how"
        )
    elif tap.is_socket():
        yield good("video", f"the preview serves its video at {tap}")
    else:
        yield wrong(
            "video",
            f"nothing serves video at {tap}",
            "Recordings have no video until it does",
            "Start the preview with video_tap.socket set to the same path",
        )
    try:
        yield from _graph(settings)
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 no topic can be recorded", error.remedy)


def _folder(settings: RecorderSettings) -> Iterator[Finding]:
    existing = next(each for each in (settings.root, *settings.root.parents) if each.exists())
    room = Limits(settings.room.quota_bytes, settings.room.min_free_bytes)
    free = room.room_bytes(used_bytes(settings.folders), disk_of(existing))
    yield from folder_findings(settings, free, writable=os.access(existing, os.W_OK | os.X_OK))


def _unreadable(folder: Path) -> str:
    """Returns why a folder can't be read; empty if it can."""
    try:
        next(folder.iterdir(), None)
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _hidden_below(folder: Path) -> Path | None:
    """Returns which of the folders that the recorder's unit hides has this one; None if none has."""
    if not is_supervised():
        return None
    whole = folder.resolve()
    return next((each for each in _HIDDEN if whole.is_relative_to(each)), None)


def _graph(settings: RecorderSettings) -> Iterator[Finding]:
    # Late: without ROS 2 the rest is still examined.
    from common.ros_node import middleware_name  # noqa: PLC0415
    from recorder.doctor.graph import look  # noqa: PLC0415

    yield from transport_finding(middleware_name())
    yield from preset_findings(settings, *look(settings))
