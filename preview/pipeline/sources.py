"""Sources: each kind as the first elements of a pipeline, checked before use.

Pure: a source is a GStreamer description, property values that can't be quoted into it, and the remedy for
its failure.
"""

import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from common.errors import UserError
from common.start_command import start_command
from preview.config import (
    AnyKind,
    CameraFormat,
    FileSource,
    GstSource,
    PreviewSettings,
    RosSource,
    TestSource,
    V4l2Source,
)
from preview.pipeline import tap_client
from preview.state.values import Target

TAP_SOURCE = "cameratapsrc"
"""Element of preview/pipeline/tap_source.py."""
CAMERA_DECODER = "cameradecoder"
"""Element of preview/pipeline/camera_decoder.py."""
CLASS_DIR = Path("/sys/class/video4linux")
CHARACTER_DEVICES = Path("/sys/dev/char")

_REMEDY_CAMERA = "Check that the camera is connected and that this user may read it (group video)"
_REMEDY_FORMAT = "; 'format: auto' takes whatever it offers"
_MEDIA_TYPES = {"auto": ("video/x-raw", "image/jpeg"), "raw": ("video/x-raw",), "jpeg": ("image/jpeg",)}
_REMEDY_FILE = "Name a video file that this user may read, under {key}.path"
_REMEDY_TAP = "Start it: {command}. With containers: docker compose --profile tap up -d"
_REMEDY_TOPIC = "'robot-tap doctor' lists the image topics and says what is wrong with them"
_REMEDY_GST = "Try it with gst-launch-1.0, and correct {key}.description"


@dataclass(frozen=True, slots=True)
class SourcePlan:
    """First elements of a pipeline.

    Args:
        camera: its name in the configuration.
        label: name for people.
        description: elements in the syntax of gst-launch, ending in raw video.
        remedy: what to do when it fails.
        properties: element name in the description -> property -> value, set after parsing.
        any_rate: generates any size and frame rate; other sources are converted.
        loops: restarts at its end.
        silence_s: without a frame for so long it has failed; None: as for all cameras.
    """

    camera: str
    label: str
    description: str
    remedy: str
    properties: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    any_rate: bool = False
    loops: bool = False
    silence_s: float | None = None


def plan_camera(settings: PreviewSettings, camera: str) -> SourcePlan:
    """Returns the first elements for a camera of the configuration.

    Args:
        settings: of the service.
        camera: its name.

    Raises:
        UserError: the camera can't be used: it is missing, unreadable or of another type.
    """
    source = settings.named_sources[camera]
    if not settings.cameras:
        return replace(_plan(settings, camera, "source", source), silence_s=source.silence_s)
    try:
        planned = _plan(settings, camera, f"cameras.{camera}", source)
    except UserError as error:
        raise UserError(f"camera {camera}: {error.what}", error.remedy) from error
    label = f"camera {camera} ({planned.label.removeprefix('camera ')})"
    return replace(planned, label=label, silence_s=source.silence_s)


def camera_problem(settings: PreviewSettings, camera: str, until_s: float) -> str | None:
    """Returns why a camera can't be used, for people; empty if it can, as far as is known without opening it.

    More than a plan does: a start waits some time for a topic that is about to be published.

    Args:
        settings: of the service.
        camera: its name.
        until_s: when the camera tap's answer is due, on `time.monotonic()`; None is returned without one.
    """
    try:
        plan_camera(settings, camera)
    except UserError as error:
        return str(error)
    source = settings.named_sources[camera]
    if not isinstance(source, RosSource):
        return ""
    problem = tap_client.topic_problem(settings.camera_tap.socket, source.topic, until_s)
    if not problem:
        return problem
    return str(UserError(f"camera {camera}: {problem}" if settings.cameras else problem, _REMEDY_TOPIC))


def _plan(settings: PreviewSettings, camera: str, key: str, source: AnyKind) -> SourcePlan:
    fastest_fps = max(target.fps for target in settings.profiles.targets.values())
    match source:
        case TestSource(pattern=pattern):
            description = f"videotestsrc is-live=true horizontal-speed=4 pattern={pattern}"
            return SourcePlan(camera, "test pattern", description, "", any_rate=True)
        case V4l2Source():
            formats = _formats(source.format, settings.profiles.largest, source.fps or fastest_fps)
            return _camera(camera, source, formats)
        case FileSource(path=path):
            return _file(camera, path, _REMEDY_FILE.format(key=key))
        case RosSource(topic=topic, fps=fps):
            return _topic(camera, topic, fps or fastest_fps, settings.camera_tap.socket)
        case GstSource(description=description):
            return SourcePlan(camera, f"{key}.description", description, _REMEDY_GST.format(key=key))


def _camera(camera: str, source: V4l2Source, formats: str) -> SourcePlan:
    device = source.device or find_card(source.card)
    try:
        status = Path(device).stat()
    except OSError as error:
        raise UserError(f"camera {device} can't be used: {error.strerror}", _REMEDY_CAMERA) from error
    if not stat.S_ISCHR(status.st_mode):
        raise UserError(f"camera {device} is not a device", "Name a device such as /dev/video11")
    if not is_plugged_in(status.st_rdev):
        raise UserError(f"camera {device} is not plugged in", _REMEDY_CAMERA)
    return SourcePlan(
        camera,
        f"camera {device}",
        f'v4l2src name=camera do-timestamp=true ! capsfilter caps="{formats}" ! {CAMERA_DECODER}',
        _REMEDY_CAMERA + ("" if source.format == "auto" else _REMEDY_FORMAT),
        properties={"camera": {"device": device}},
    )


def _formats(form: CameraFormat, largest: Target, fps: int) -> str:
    """Returns the caps that a camera is asked for.

    Of what both sides can do, v4l2src takes what is nearest to the largest values of the first structure: the
    rate counts more than the size, and both more than the format (gst_v4l2src_negotiate). So a camera that
    sends uncompressed frames of this size slowly is asked for JPEG, and no larger frames than needed are
    decoded. One that has only larger frames gives those. One that has no such rate posts an error.
    """
    rate = f"framerate=[1/1,{fps}/1]"
    size = f"width=[1,{largest.width_px}],height=[1,{largest.height_px}]"
    medias = _MEDIA_TYPES[form]
    return "; ".join([f"{media},{size},{rate}" for media in medias] + [f"{media},{rate}" for media in medias])


def is_plugged_in(device: int, devices: Path = CHARACTER_DEVICES) -> bool:
    """Returns whether the kernel has a device. In a container, its node outlives it.

    Args:
        device: its number, st_rdev of stat(2).
        devices: of the kernel, by major and minor number; where there is no such list, every device counts.
    """
    return not devices.is_dir() or (devices / f"{os.major(device)}:{os.minor(device)}").exists()


def find_card(card: str, class_dir: Path = CLASS_DIR) -> str:
    """Returns the device node of a card, the one with the lowest number when it has several.

    Raises:
        UserError: there is no such card; the error lists the existing ones.
    """
    names = {entry: _card_name(entry) for entry in class_dir.glob("video*")}
    matches = [entry.name for entry, name in names.items() if name == card]
    if matches:
        return f"/dev/{min(matches, key=lambda name: int(name.removeprefix('video')))}"
    found = ", ".join(sorted(set(filter(None, names.values())))) or "none"
    raise UserError(f"no camera is called '{card}' (found: {found})", _REMEDY_CAMERA)


def _card_name(entry: Path) -> str:
    try:
        return (entry / "name").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""  # Unplugged in the meantime.


def _topic(camera: str, topic: str, fps: int, socket: Path) -> SourcePlan:
    if problem := tap_client.connection_problem(socket):
        command = start_command("robot-tap")
        raise UserError(
            f"topic {topic} can't be shown: no camera tap serves {socket} ({problem})",
            _REMEDY_TAP.format(command=command),
        )
    return SourcePlan(
        camera,
        f"topic {topic}",
        f"{TAP_SOURCE} name=tap",
        _REMEDY_TOPIC,
        properties={"tap": {"socket": str(socket), "topic": topic, "fps": str(fps)}},
    )


def _file(camera: str, path: Path, remedy: str) -> SourcePlan:
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise UserError(f"video file {path} can't be read: {error.strerror}", remedy) from error
    if empty:
        raise UserError(f"video file {path} is empty", remedy)
    return SourcePlan(
        camera,
        f"video file {path}",
        # Only video is decoded; clocksync plays it at its own speed.
        'filesrc name=file ! decodebin caps="video/x-raw(ANY)" expose-all-streams=false'
        " ! clocksync name=pace",
        remedy,
        properties={"file": {"location": str(path)}},
        loops=True,
    )
