"""The one table of a robot's status: which rows there are, in which order, and what each says.

A terminal shows the whole of it with full texts; the monitor's side panel shows the compact density, because
health, faults and preview have places of their own in the window.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, TypeAlias

from console.client import results
from console.client.results import (
    CameraState,
    PreviewProfile,
    PreviewState,
    SourceState,
    TeleopState,
)
from console.presentation.cloud import cloud_summary
from console.presentation.driving import driving_mark, driving_text
from console.presentation.formatting import (
    UNKNOWN,
    joined,
    plural,
    quantity,
    sentence,
)
from console.presentation.health import active_severities, health_style, health_summary
from console.presentation.measured_text import (
    attitude_text,
    battery_text,
    command_text,
    compute_text,
    motion_text,
    network_text,
    number_text,
    position_text,
    video_text,
    vision_text,
)
from console.presentation.recording import recorder_mark, recording_summary
from console.presentation.severity_style import (
    CLOUD_STYLES,
    FAULT_STYLES,
    PREVIEW_STYLES,
    SeverityStyle,
)
from console.presentation.status_row import Look, Row, View, unbroken
from console.presentation.value_style import (
    BATTERY_FAULTS,
    COMPUTE_FAULTS,
    COMPUTER_BATTERY_FAULTS,
    GOOD,
    NETWORK_FAULTS,
    ORIENTATION_FAULTS,
    Judgement,
    of_battery,
    of_compute,
    of_network,
    of_number,
    of_orientation,
    of_position,
    of_text,
    of_video,
    with_faults,
)

_CAMERA_IN_USE: Final = (CameraState.LIVE, CameraState.STARTING)
_LONGEST_TITLE: Final = 40
_UNREADABLE: Final = (
    SourceState.QOS_MISMATCH,
    SourceState.WRONG_TYPE,
    SourceState.TYPE_MISSING,
    SourceState.FIELD_MISSING,
    SourceState.UNDECODABLE,
)


_NOW: Final = Look()


def table_rows(view: View) -> list[Row]:
    """Returns the rows of the table, the most important first."""
    return [row for rows in TABLE for row in rows(view)]


def preview_rows(
    preview: results.PreviewStatus, look: Look = _NOW, *, with_fallback: bool = True
) -> Iterator[Row]:
    """Yields the preview's state, then its error, fallback, figures and address as far as there are any."""
    summary = _preview_summary(preview)
    yield look.state("preview", preview.state.value, PREVIEW_STYLES[preview.state], summary)
    if preview.last_error:
        yield look.present("", "error", SeverityStyle.BAD, preview.last_error)
    if with_fallback and preview.encoder and preview.encoder.fallback_reason:
        reason = f"preferred {preview.encoder.wanted}, {preview.encoder.fallback_reason}"
        yield look.present("", "fallback", SeverityStyle.WARNING, reason)
    if preview.bitrate_reason:
        yield look.present("", "bit rate", SeverityStyle.WARNING, preview.bitrate_reason)
    if len(preview.cameras) > 1:
        yield from _cameras(preview, look)
    if preview.measured.available:
        text = video_text(preview.measured, False, preview.target_bitrate_kbps)
        yield look.measured("stream", preview.measured, text, of_video(preview.measured))
    if preview.endpoint and preview.state is PreviewState.RUNNING:
        encryption = "encrypted" if preview.endpoint.encrypted else ""
        latency = f"latency {preview.endpoint.latency_ms} ms"
        address = joined(preview.endpoint.uri, latency, encryption)
        yield look.present("", "watch", SeverityStyle.QUIET, address)


def _cameras(preview: results.PreviewStatus, look: Look) -> Iterator[Row]:
    """Yields the cameras: those that work in one row, each of the others in a row of its own."""
    working = [camera for camera in preview.cameras if camera.state is not CameraState.FAILED]
    shown = (
        f"{camera.name} ({camera.state.value})" if camera.state in _CAMERA_IN_USE else camera.name
        for camera in working
    )
    if working:
        yield look.present("", "cameras", SeverityStyle.QUIET, joined(*shown))
    for camera in preview.cameras:
        if camera.state is CameraState.FAILED:
            wanted = "wanted; " if camera.name == preview.wanted_camera else ""
            style = SeverityStyle.WARNING if wanted else SeverityStyle.QUIET
            yield look.present("", "camera", style, f"{camera.name}: {wanted}{camera.error}")


def _health(view: View) -> Iterator[Row]:
    status = view.status
    style = health_style(status.health.state, active_severities(status.faults))
    yield view.state("health", status.health.state.value, style, health_summary(status))


def _faults(view: View) -> Iterator[Row]:
    for fault in view.status.faults:
        if fault.active:
            text = f"{fault.message} -> {fault.remedy}" if fault.remedy else fault.message
            style, age = FAULT_STYLES[fault.severity], view.age(fault.age_ms)
            yield view.present("fault", fault.severity.value, style, text, age)
        else:
            cleared_age = view.age(fault.cleared_age_ms)
            yield Row("fault", "cleared", SeverityStyle.QUIET, fault.message, cleared_age)


def _objects(view: View) -> Iterator[Row]:
    configured = {source.name for source in view.status.sources}
    # An older gateway does not list its sources.
    if view.detections and (not configured or "detections" in configured):
        yield view.measured("objects", view.detections, plural(view.detections.count, "object"))


def number_rows(numbers: Iterable[results.NumberValue], look: Look) -> Iterator[Row]:
    """Yields a row for each number, judged by the robot's own limits."""
    for each in numbers:
        row = look.measured("", each, number_text(each), of_number(each))
        yield replace(row, label=_title(each.title, look))


def text_rows(texts: Iterable[results.TextValue], look: Look) -> Iterator[Row]:
    """Yields a row for each text, judged by the robot's own levels."""
    for each in texts:
        row = look.measured("", each, UNKNOWN if each.text is None else each.text, of_text(each))
        # The robot's own words: unlike a number and its unit they may be broken anywhere.
        yield replace(row, label=_title(each.title, look), text=row.text.replace("\u00a0", " "))


def pose_rows(
    position: results.Position,
    orientation: results.Orientation,
    look: Look,
    faults: Iterable[results.Fault] = (),
) -> Iterator[Row]:
    """Yields where the robot is and how it stands, as far as it reports that."""
    if position.available:
        text = position_text(position, look.compact)
        yield look.measured("position", position, text, of_position(position))
    if orientation.available:
        text = attitude_text(orientation, look.compact)
        found = with_faults(of_orientation(orientation), faults, ORIENTATION_FAULTS)
        yield look.measured("attitude", orientation, text, found)


def _poses(view: View) -> Iterator[Row]:
    return pose_rows(view.status.position, view.status.orientation, view, view.status.faults)


def _numbers(view: View) -> Iterator[Row]:
    return number_rows(view.status.numbers, view)


def _texts(view: View) -> Iterator[Row]:
    return text_rows(view.status.texts, view)


def _title(title: str, look: Look) -> str:
    """Not as `Look.label` writes it: a title may have capitals of its own, CO2 for example."""
    short = title[:_LONGEST_TITLE]
    return sentence(short) if look.compact else short


def _access(view: View) -> Iterator[Row]:
    if view.status.insecure:
        risk = "not encrypted, any computer on the network can switch the preview"
        yield Row(view.label("access"), "OPEN", SeverityStyle.WARNING, risk)


def _sources(view: View) -> Iterator[Row]:
    faults = {fault.message for fault in view.status.faults if fault.active}
    for source in view.status.sources:
        if view.compact:
            # The other rows show that a value is missing; this one, that it can never come.
            if source.state in _UNREADABLE:
                style = SeverityStyle.WARNING if source.required else SeverityStyle.QUIET
                label = view.label(source.name.replace("_", " "))
                yield Row(label, "no data", style, source.detail, view.age(source.age_ms))
        elif source.state is not SourceState.RECEIVING and source.detail not in faults:
            mark = source.state.value.replace("_", " ")
            text = source.detail or source.name
            yield Row("source", mark, SeverityStyle.QUIET, text, view.age(source.age_ms))


def _gateway(view: View) -> Iterator[Row]:
    gateway = view.status.gateway
    # An older gateway does not report its uptime; a silent one may not be up any more.
    if gateway.uptime_ms is None or view.outdated:
        return
    text = plural(gateway.client_count, "client")
    if not view.compact:
        text = joined(
            text,
            plural(gateway.requests_served, "answer"),
            plural(gateway.requests_refused, "refusal") if gateway.requests_refused else "",
            f"revision {gateway.revision[:12]}" if gateway.revision else "",
        )
    yield Row(view.label("gateway"), "up", SeverityStyle.QUIET, text, view.age(gateway.uptime_ms))


def _preview(view: View) -> Iterator[Row]:
    # One warning is enough: the fault above says the same.
    reported = any(fault.active and fault.id == "preview.fallback" for fault in view.status.faults)
    return preview_rows(view.status.preview, view, with_fallback=not reported)


def _teleop(view: View) -> Iterator[Row]:
    teleop = view.status.teleop
    if teleop.state is TeleopState.UNKNOWN:
        return
    linear, angular = quantity(teleop.max_linear_mps, "m/s"), quantity(teleop.max_angular_rad_s, "rad/s")
    limits = f"at most {linear}, {angular}" if teleop.enabled else ""
    text = joined(driving_text(teleop), unbroken(limits) if view.compact else limits, teleop.last_error)
    row = view.state(view.label("teleop"), *driving_mark(teleop), text)
    yield row if view.compact else replace(row, age=view.age(teleop.last_command.age_ms))


def _recording(view: View) -> Iterator[Row]:
    recording = view.status.recording
    if recording is not None:
        text = recording_summary(recording, compact=view.compact)
        yield view.state(view.label("recording"), *recorder_mark(recording), text)


def _cloud(view: View) -> Iterator[Row]:
    cloud = view.status.cloud
    if cloud is not None:
        text = cloud_summary(cloud, compact=view.compact)
        row = view.state(view.label("fleet"), cloud.state.value, CLOUD_STYLES[cloud.state], text)
        yield row if view.compact else replace(row, age=view.age(cloud.state_age_ms))


def _preview_summary(preview: results.PreviewStatus) -> str:
    encoder, video = preview.encoder, preview.video
    return joined(
        "" if preview.profile is PreviewProfile.UNKNOWN else preview.profile.value,
        f"{video.width_px}x{video.height_px} at {video.fps:g} fps" if video else "",
        f"{encoder.name} ({'hardware' if encoder.hardware else 'software'})" if encoder else "",
        "" if preview.service_reachable else "preview service not reachable",
        plural(preview.counters.faults, "fault") if preview.counters.faults else "",
    )


Rows: TypeAlias = Callable[[View], Iterator[Row]]
"""Yields the rows of a part; none where it has nothing to show."""


def _full(rows: Rows) -> Rows:
    """Returns the rows of a part that has a place of its own beside the compact table."""
    return lambda view: iter(()) if view.compact else rows(view)


def _compact(rows: Rows) -> Rows:
    """Returns the rows of a part that only the compact table has."""
    return lambda view: rows(view) if view.compact else iter(())


def _measured(
    label: str,
    sample: Callable[[results.SystemStatus], Any],
    text: Callable[[Any, bool], str],
    judge: Callable[[Any], Judgement] = lambda _: GOOD,
    faults: Mapping[str, str] = MappingProxyType({}),
    *,
    optional: bool = False,
) -> Rows:
    """Returns the rows of one measured part; an optional one has none on a robot that never reports it."""

    def rows(view: View) -> Iterator[Row]:
        part = sample(view.status)
        found = with_faults(judge(part), view.status.faults, faults)
        row = view.measured(label, part, text(part, view.compact), found)
        if row.text or not optional:
            yield row

    return rows


TABLE: Final[tuple[Rows, ...]] = (
    _full(_health),
    _full(_faults),
    _measured("motion", lambda status: status.odometry, motion_text),
    _measured("vision", lambda status: status.vision, vision_text),
    _objects,
    _full(_preview),
    _measured(
        "battery",
        lambda status: status.platform.power.lipo_battery,
        battery_text,
        of_battery,
        BATTERY_FAULTS,
    ),
    _measured("command", lambda status: status.effective_command, command_text, optional=True),
    _measured("mode", lambda status: status.mission, lambda mission, _: mission.mode or "", optional=True),
    _measured(
        "computer",
        lambda status: status.platform.compute,
        compute_text,
        of_compute,
        COMPUTE_FAULTS,
        optional=True,
    ),
    _measured(
        "computer battery",
        lambda status: status.platform.power.onboard_battery,
        battery_text,
        of_battery,
        COMPUTER_BATTERY_FAULTS,
        optional=True,
    ),
    _measured(
        "network",
        lambda status: status.platform.network,
        network_text,
        of_network,
        NETWORK_FAULTS,
        optional=True,
    ),
    _poses,
    _numbers,
    _texts,
    _compact(_measured("video", lambda status: status.preview.measured, video_text, of_video, optional=True)),
    _teleop,
    _recording,
    _cloud,
    _access,
    _gateway,
    _sources,
)
"""All rows, in the order of an operator's interest."""
