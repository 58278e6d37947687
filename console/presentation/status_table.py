"""The one table of a robot's status: which rows there are, in which order, and what each says.

A terminal shows the whole of it with full texts; the monitor's side panel shows the compact density, because
health, faults and preview have places of their own in the window.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, TypeAlias

from console.client import results
from console.client.results import (
    CameraState,
    FaultSeverity,
    FixStatus,
    Freshness,
    PreviewProfile,
    PreviewState,
    SourceState,
    TeleopState,
)
from console.presentation.cloud import cloud_summary
from console.presentation.driving import driving_mark, driving_text
from console.presentation.formatting import (
    UNKNOWN,
    age,
    bit_rate,
    gibibytes,
    joined,
    plural,
    quantity,
    sentence,
    signed,
)
from console.presentation.recording import recorder_mark, recording_summary
from console.presentation.severity_style import (
    CLOUD_STYLES,
    FAULT_STYLES,
    FRESHNESS_STYLES,
    HEALTH_STYLES,
    PREVIEW_STYLES,
    SeverityStyle,
)
from console.presentation.value_style import (
    GOOD,
    Judgement,
    of_battery,
    of_compute,
    of_network,
    of_number,
    of_orientation,
    of_position,
    of_text,
    of_video,
)

_MARKS: Final = {Freshness.FRESH: "fresh", Freshness.STALE: "STALE", Freshness.MISSING: "no data"}
_CAMERA_IN_USE: Final = (CameraState.LIVE, CameraState.STARTING)
_REMARKABLE_AGE_MS: Final = 2000
_LONGEST_TITLE: Final = 40
_MOST_DECIMALS: Final = 9
"""As the gateway's configuration allows; another gateway may send anything."""
_LARGE: Final = 1e15
"""A binary64 has no digits behind the point from about here on."""
_UNREADABLE: Final = (
    SourceState.QOS_MISMATCH,
    SourceState.WRONG_TYPE,
    SourceState.TYPE_MISSING,
    SourceState.FIELD_MISSING,
    SourceState.UNDECODABLE,
)


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table."""

    label: str
    mark: str
    """One word: "fresh", "STALE", "no data", "RUNNING" ..."""
    style: SeverityStyle
    text: str
    age: str = ""
    remedy: str = ""
    """What to do about a fault, where the text does not say it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How a part of a status is looked at.

    Args:
        compact: Whether texts must be short.
        silent_ms: Time since the status was received; ages count on by it.
        outdated: Whether that is so long that fresh values count as stale.
    """

    compact: bool = False
    silent_ms: int = 0
    outdated: bool = False

    def age(self, age_ms: int | None) -> str:
        """Returns an age as of now; empty in the compact density where there is none."""
        if age_ms is None:
            return "" if self.compact else UNKNOWN
        return age(age_ms + self.silent_ms)

    def label(self, label: str) -> str:
        """Returns the label as the density writes it."""
        return label.capitalize() if self.compact else label

    def state(self, label: str, state: str, style: SeverityStyle, text: str) -> Row:
        """Returns the row of a state, which reads "last known" once the status is outdated."""
        if self.outdated:
            last = joined(f"last known: {state.upper()}", text)
            return Row(label, _MARKS[Freshness.STALE], SeverityStyle.WARNING, last)
        return Row(label, state.upper(), style, text)

    def measured(self, label: str, sample: results.Sample, text: str, found: Judgement = GOOD) -> Row:
        """Returns the row of a measured part: marked by its freshness, empty while it is missing.

        Args:
            label: of the row.
            sample: the part.
            text: its values.
            found: how good these are, which counts while they are fresh.
        """
        freshness = sample.freshness
        if freshness is Freshness.FRESH and self.outdated:
            freshness = Freshness.STALE
        text = text if sample.available else ""
        fresh = freshness is Freshness.FRESH
        return Row(
            self.label(label),
            (fresh and found.word) or _MARKS[freshness],
            found.style if fresh else FRESHNESS_STYLES[freshness],
            _unbroken(text) if self.compact else text,
            "" if fresh and self._is_unremarkable(sample.age_ms) else self.age(sample.age_ms),
        )

    def _is_unremarkable(self, age_ms: int | None) -> bool:
        """Whether an age says no more than "fresh" does, where texts must be short."""
        return self.compact and (age_ms or 0) + self.silent_ms < _REMARKABLE_AGE_MS


_NOW: Final = Look()


@dataclass(frozen=True, slots=True)
class View(Look):
    """A whole status, and how it is looked at.

    Args:
        status: The newest one.
        detections: The newest ones; None where the view has none.
    """

    status: results.SystemStatus
    detections: results.Detections | None = None


def table_rows(view: View) -> list[Row]:
    """Returns the rows of the table, the most important first."""
    return [row for rows in TABLE for row in rows(view)]


def preview_rows(preview: results.PreviewStatus, look: Look = _NOW) -> Iterator[Row]:
    """Yields the preview's state, then its error, fallback, figures and address as far as there are any."""
    summary = _preview_summary(preview)
    yield look.state("preview", preview.state.value, PREVIEW_STYLES[preview.state], summary)
    if preview.last_error:
        yield Row("", "error", SeverityStyle.BAD, preview.last_error)
    if preview.encoder and preview.encoder.fallback_reason:
        reason = f"preferred {preview.encoder.wanted}, {preview.encoder.fallback_reason}"
        yield Row("", "fallback", SeverityStyle.WARNING, reason)
    if preview.bitrate_reason:
        yield Row("", "bit rate", SeverityStyle.WARNING, preview.bitrate_reason)
    if len(preview.cameras) > 1:
        yield from _cameras(preview)
    if preview.measured.available:
        text = _video(preview.measured, False, preview.target_bitrate_kbps)
        yield look.measured("stream", preview.measured, text, of_video(preview.measured))
    if preview.endpoint and preview.state is PreviewState.RUNNING:
        encryption = "encrypted" if preview.endpoint.encrypted else ""
        latency = f"latency {preview.endpoint.latency_ms} ms"
        yield Row("", "watch", SeverityStyle.QUIET, joined(preview.endpoint.uri, latency, encryption))


def _cameras(preview: results.PreviewStatus) -> Iterator[Row]:
    """Yields the cameras: those that work in one row, each of the others in a row of its own."""
    working = [camera for camera in preview.cameras if camera.state is not CameraState.FAILED]
    shown = (
        f"{camera.name} ({camera.state.value})" if camera.state in _CAMERA_IN_USE else camera.name
        for camera in working
    )
    if working:
        yield Row("", "cameras", SeverityStyle.QUIET, joined(*shown))
    for camera in preview.cameras:
        if camera.state is CameraState.FAILED:
            wanted = "wanted; " if camera.name == preview.wanted_camera else ""
            style = SeverityStyle.WARNING if wanted else SeverityStyle.QUIET
            yield Row("", "camera", style, f"{camera.name}: {wanted}{camera.error}")


def health_summary(status: results.SystemStatus) -> str:
    """Returns the reason of the health, and how many errors and warnings are active."""
    severities = [fault.severity for fault in status.faults if fault.active]
    counts = joined(
        *(
            plural(number, severity.value)
            for severity in (FaultSeverity.ERROR, FaultSeverity.WARNING)
            if (number := severities.count(severity))
        )
    )
    return status.health.summary + (f" ({counts})" if counts else "")


def _health(view: View) -> Iterator[Row]:
    health = view.status.health
    yield view.state("health", health.state.value, HEALTH_STYLES[health.state], health_summary(view.status))


def _faults(view: View) -> Iterator[Row]:
    for fault in view.status.faults:
        if fault.active:
            text = f"{fault.message} -> {fault.remedy}" if fault.remedy else fault.message
            yield Row(
                "fault", fault.severity.value, FAULT_STYLES[fault.severity], text, view.age(fault.age_ms)
            )
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


def pose_rows(position: results.Position, orientation: results.Orientation, look: Look) -> Iterator[Row]:
    """Yields where the robot is and how it stands, as far as it reports that."""
    if position.available:
        text = _position(position, look.compact)
        yield look.measured("position", position, text, of_position(position))
    if orientation.available:
        text = _attitude(orientation, look.compact)
        yield look.measured("attitude", orientation, text, of_orientation(orientation))


def _poses(view: View) -> Iterator[Row]:
    return pose_rows(view.status.position, view.status.orientation, view)


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
    rows = preview_rows(view.status.preview, view)
    return (row for row in rows if not (reported and row.mark == "fallback"))


def _teleop(view: View) -> Iterator[Row]:
    teleop = view.status.teleop
    if teleop.state is TeleopState.UNKNOWN:
        return
    linear, angular = quantity(teleop.max_linear_mps, "m/s"), quantity(teleop.max_angular_rad_s, "rad/s")
    limits = f"at most {linear}, {angular}" if teleop.enabled else ""
    text = joined(driving_text(teleop), _unbroken(limits) if view.compact else limits, teleop.last_error)
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


def _motion(odometry: results.Odometry, compact: bool) -> str:
    return joined(
        quantity(odometry.linear_speed_mps, "m/s", 2),
        "" if compact else f"forward {signed(odometry.vx_mps)} m/s",
        "" if compact else f"left {signed(odometry.vy_mps)} m/s",
        f"turning {signed(odometry.wz_rad_s)} rad/s",
    )


def _vision(vision: results.Vision, compact: bool) -> str:
    inference = f"inference {quantity(vision.last_infer_ms, 'ms')}"
    errors, fatal = vision.infer_error_count or 0, vision.capture_fatal_error_count or 0
    if compact:
        return joined(
            quantity(vision.consumer_fps, "fps"),
            inference,
            plural(errors + fatal, "error") if errors + fatal else "",
        )
    return joined(
        f"camera {quantity(vision.producer_fps, 'fps')}",
        f"evaluated {quantity(vision.consumer_fps, 'fps')}",
        inference,
        plural(errors, "inference error") if errors else "",
        plural(fatal, "camera error") if fatal else "",
    )


def _battery(battery: results.Battery, compact: bool) -> str:
    if battery.present is False:
        return "not installed"
    return joined(
        quantity(battery.charge_percent, "%", 0),
        "" if compact and battery.voltage_v is None else quantity(battery.voltage_v, "V"),
        {True: "charging", False: "discharging", None: ""}[battery.charging],
        "" if compact else battery.source or "",
    )


def _command(command: results.EffectiveCommand, compact: bool) -> str:
    source = command.active_source or "unknown"
    forward, turning = f"{signed(command.vx_mps)} m/s", f"{signed(command.wz_rad_s)} rad/s"
    if compact:
        return joined(source, forward, turning)
    left = f"left {signed(command.vy_mps)} m/s"
    return joined(f"from {source}", f"forward {forward}", left, f"turning {turning}")


def _compute(compute: results.Compute, compact: bool) -> str:
    temperature, disk = compute.cpu_temperature_c, compute.disk_used_percent
    used, total = gibibytes(compute.ram_used_bytes), gibibytes(compute.ram_total_bytes)
    return joined(
        f"CPU {quantity(compute.cpu_percent, '%', 0)}",
        "" if temperature is None else quantity(temperature, "°C", 0),
        "throttled by heat" if compute.thermal_throttled else "",
        f"memory {quantity(compute.ram_used_percent, '%', 0) if compact else f'{used} of {total}'}",
        "" if disk is None else f"disk {quantity(disk, '%', 0)}",
    )


def _network(network: results.Network, compact: bool) -> str:
    signal, quality = network.wifi_signal_dbm, network.link_quality_percent
    return joined(
        network.interface_name or ("" if compact else UNKNOWN),
        "connected" if network.connected else "not connected",
        "" if signal is None else f"{signal} dBm",
        "" if compact or quality is None else f"link quality {quality} %",
    )


def _position(position: results.Position, compact: bool) -> str:
    latitude, longitude = position.latitude_deg, position.longitude_deg
    if latitude is None or longitude is None:
        return UNKNOWN if position.available else ""
    accuracy, altitude = position.horizontal_accuracy_m, position.altitude_m
    return joined(
        f"{latitude:.6f}°",
        f"{longitude:.6f}°",
        "" if accuracy is None else f"± {quantity(accuracy, 'm')}",
        "" if compact or altitude is None else f"altitude {quantity(altitude, 'm')}",
        "" if compact or position.fix is FixStatus.UNKNOWN else position.fix.value.upper(),
    )


def _attitude(orientation: results.Orientation, _compact: bool) -> str:
    angles = {"roll": orientation.roll_deg, "pitch": orientation.pitch_deg, "yaw": orientation.yaw_deg}
    if orientation.roll_deg is None:
        return UNKNOWN if orientation.available else ""
    return joined(*(f"{name} {signed(angle, 1)}°" for name, angle in angles.items()))


def _video(measured: results.PreviewMeasurement, compact: bool, target_kbps: int = 0) -> str:
    rtt_ms, loss_percent = measured.worst_rtt_ms, measured.worst_loss_percent
    picture_age_ms = measured.worst_picture_age_ms
    return joined(
        bit_rate(measured.bitrate_kbps) + ("" if compact else f" of {bit_rate(target_kbps)}"),
        quantity(measured.fps, "fps"),
        plural(measured.viewer_count, "viewer"),
        "" if compact or rtt_ms is None else f"round trip {quantity(rtt_ms, 'ms')}",
        ""
        if loss_percent is None or (compact and not loss_percent)
        else f"loss {quantity(loss_percent, '%')}",
        "" if compact or picture_age_ms is None else f"picture {quantity(picture_age_ms, 'ms', 0)} old",
    )


def _preview_summary(preview: results.PreviewStatus) -> str:
    encoder, video = preview.encoder, preview.video
    return joined(
        "" if preview.profile is PreviewProfile.UNKNOWN else preview.profile.value,
        f"{video.width_px}x{video.height_px} at {video.fps:g} fps" if video else "",
        f"{encoder.name} ({'hardware' if encoder.hardware else 'software'})" if encoder else "",
        "" if preview.service_reachable else "preview service not reachable",
        plural(preview.counters.faults, "fault") if preview.counters.faults else "",
    )


def number_text(number: results.NumberValue) -> str:
    """Returns the number as its configuration wants it shown, with its unit."""
    if number.value is None:
        return UNKNOWN
    if number.decimals is None or abs(number.value) >= _LARGE:
        digits = f"{number.value:.10g}"
    else:
        digits = f"{number.value:.{min(number.decimals, _MOST_DECIMALS)}f}"
    return f"{digits} {number.unit}".strip()


def _unbroken(text: str) -> str:
    """Returns the text with line breaks possible behind commas only, never between a number and its unit."""
    return ", ".join(part.replace(" ", "\u00a0") for part in text.split(", "))


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
    *,
    optional: bool = False,
) -> Rows:
    """Returns the rows of one measured part; an optional one has none on a robot that never reports it."""

    def rows(view: View) -> Iterator[Row]:
        part = sample(view.status)
        row = view.measured(label, part, text(part, view.compact), judge(part))
        if row.text or not optional:
            yield row

    return rows


TABLE: Final[tuple[Rows, ...]] = (
    _full(_health),
    _full(_faults),
    _measured("motion", lambda status: status.odometry, _motion),
    _measured("vision", lambda status: status.vision, _vision),
    _objects,
    _full(_preview),
    _measured("battery", lambda status: status.platform.power.lipo_battery, _battery, of_battery),
    _measured("command", lambda status: status.effective_command, _command, optional=True),
    _measured("mode", lambda status: status.mission, lambda mission, _: mission.mode or "", optional=True),
    _measured("computer", lambda status: status.platform.compute, _compute, of_compute, optional=True),
    _measured(
        "computer battery",
        lambda status: status.platform.power.onboard_battery,
        _battery,
        of_battery,
        optional=True,
    ),
    _measured("network", lambda status: status.platform.network, _network, of_network, optional=True),
    _poses,
    _numbers,
    _texts,
    _compact(_measured("video", lambda status: status.preview.measured, _video, of_video, optional=True)),
    _teleop,
    _recording,
    _cloud,
    _access,
    _gateway,
    _sources,
)
"""All rows, in the order of an operator's interest."""
