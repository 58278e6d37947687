"""A status as rows for people: what, how it is, the values, their age. Pure text; no terminal is needed."""

from collections.abc import Iterator
from dataclasses import dataclass

from console.client.results import (
    Battery,
    Compute,
    EffectiveCommand,
    Fault,
    FaultSeverity,
    Freshness,
    GatewayFacts,
    HealthState,
    Network,
    Odometry,
    PreviewState,
    PreviewStatus,
    Sample,
    SourceState,
    SystemStatus,
    Teleop,
    TeleopState,
    Vision,
)
from console.tone import Tone
from console.words import UNKNOWN, age, gibibytes, joined, plural, quantity, signed


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a status table."""

    label: str
    mark: str
    """One word: "fresh", "STALE", "no data", "RUNNING" ..."""
    tone: Tone
    text: str
    age: str = ""


_FRESHNESS = {
    Freshness.FRESH: ("fresh", Tone.GOOD),
    Freshness.STALE: ("STALE", Tone.WARNING),
    Freshness.MISSING: ("no data", Tone.QUIET),
}
_HEALTH = {HealthState.OK: Tone.GOOD, HealthState.DEGRADED: Tone.WARNING, HealthState.UNKNOWN: Tone.QUIET}
_PREVIEW = {
    PreviewState.RUNNING: Tone.GOOD,
    PreviewState.STARTING: Tone.WARNING,
    PreviewState.STOPPING: Tone.WARNING,
    PreviewState.FAULTED: Tone.BAD,
    PreviewState.DISABLED: Tone.QUIET,
    PreviewState.UNKNOWN: Tone.QUIET,
}

_SEVERITY = {
    FaultSeverity.ERROR: Tone.BAD,
    FaultSeverity.WARNING: Tone.WARNING,
    FaultSeverity.INFO: Tone.QUIET,
    FaultSeverity.UNKNOWN: Tone.WARNING,
}


def status_rows(status: SystemStatus) -> list[Row]:
    """Everything worth a line, most important first."""
    health = status.health
    power = status.platform.power
    rows = [
        Row("health", health.state.value.upper(), _HEALTH[health.state], health.summary),
        *_fault_rows(status.faults),
        _sampled("motion", status.odometry, _motion(status.odometry)),
        _sampled("vision", status.vision, _vision(status.vision)),
        *preview_rows(status.preview),
        _sampled("battery", power.lipo_battery, _battery(power.lipo_battery)),
    ]
    if status.insecure:
        rows.append(
            Row(
                "access",
                "OPEN",
                Tone.WARNING,
                "not encrypted; everybody on the network may switch the preview",
            )
        )
    # What this robot's gateway never reports has no line.
    optional = (
        _sampled("computer battery", power.onboard_battery, _battery(power.onboard_battery)),
        _sampled("computer", status.platform.compute, _compute(status.platform.compute)),
        _sampled("network", status.platform.network, _network(status.platform.network)),
        _sampled("mode", status.mission, status.mission.mode or ""),
        _sampled("command", status.effective_command, _command(status.effective_command)),
    )
    rows += [row for row in optional if row.text]
    rows += _source_rows(status)
    rows += _gateway_rows(status.gateway)
    return rows + list(_teleop_rows(status.teleop))


def preview_rows(preview: PreviewStatus) -> Iterator[Row]:
    """The preview: its state, then whatever there is to say about it."""
    yield Row("preview", preview.state.value.upper(), _PREVIEW[preview.state], _preview_summary(preview))
    if preview.last_error:
        yield Row("", "error", Tone.BAD, preview.last_error)
    if preview.encoder and preview.encoder.fallback_reason:
        reason = f"wanted {preview.encoder.wanted}, {preview.encoder.fallback_reason}"
        yield Row("", "fallback", Tone.WARNING, reason)
    if preview.bitrate_reason:
        yield Row("", "bit rate", Tone.WARNING, preview.bitrate_reason)
    if preview.measured.available:
        yield _sampled("stream", preview.measured, _stream(preview))
    if preview.endpoint and preview.state is PreviewState.RUNNING:
        lock = "encrypted" if preview.endpoint.encrypted else ""
        latency = f"latency {preview.endpoint.latency_ms} ms"
        yield Row("", "watch", Tone.QUIET, joined(preview.endpoint.uri, latency, lock))


def _fault_rows(faults: tuple[Fault, ...]) -> Iterator[Row]:
    for fault in faults:
        if fault.active:
            text = f"{fault.message} -> {fault.remedy}" if fault.remedy else fault.message
            mark = fault.severity.value
            yield Row("fault", mark, _SEVERITY[fault.severity], text, age(fault.age_ms))
        else:
            yield Row("fault", "over", Tone.QUIET, fault.message, age(fault.cleared_age_ms))


def _sampled(label: str, sample: Sample, text: str) -> Row:
    mark, tone = _FRESHNESS[sample.freshness]
    return Row(label, mark, tone, text if sample.available else "", age(sample.age_ms))


def _motion(odometry: Odometry) -> str:
    return joined(
        quantity(odometry.linear_speed_mps, "m/s", 2),
        f"forward {signed(odometry.vx_mps)} m/s",
        f"left {signed(odometry.vy_mps)} m/s",
        f"turning {signed(odometry.wz_rad_s)} rad/s",
    )


def _vision(vision: Vision) -> str:
    return joined(
        f"camera {quantity(vision.producer_fps, 'fps')}",
        f"evaluated {quantity(vision.consumer_fps, 'fps')}",
        f"inference {quantity(vision.last_infer_ms, 'ms')}",
        plural(vision.infer_error_count, "inference error") if vision.infer_error_count else "",
        plural(vision.capture_fatal_error_count, "camera error") if vision.capture_fatal_error_count else "",
    )


def _preview_summary(preview: PreviewStatus) -> str:
    encoder = preview.encoder
    video = preview.video
    return joined(
        preview.profile.value if preview.profile.value != "unknown" else "",
        f"{video.width_px}x{video.height_px} at {video.fps:g} fps" if video else "",
        f"{encoder.name} ({'hardware' if encoder.hardware else 'software'})" if encoder else "",
        "" if preview.service_reachable else "preview service not reachable",
        plural(preview.counters.faults, "fault") if preview.counters.faults else "",
    )


def _stream(preview: PreviewStatus) -> str:
    measured = preview.measured
    return joined(
        f"{quantity(measured.bitrate_kbps, 'kbit/s', 0)} of {preview.target_bitrate_kbps}",
        quantity(measured.fps, "fps"),
        plural(measured.viewer_count, "viewer"),
        "" if measured.worst_rtt_ms is None else f"round trip {quantity(measured.worst_rtt_ms, 'ms')}",
        "" if measured.worst_loss_percent is None else f"loss {quantity(measured.worst_loss_percent, '%')}",
    )


def _battery(battery: Battery) -> str:
    if battery.present is False:
        return "not in its place"
    charging = {True: "charging", False: "discharging", None: ""}[battery.charging]
    return joined(
        quantity(battery.charge_percent, "%", 0),
        quantity(battery.voltage_v, "V"),
        charging,
        battery.source or "",
    )


def _compute(compute: Compute) -> str:
    temperature = compute.cpu_temperature_c
    disk = compute.disk_used_percent
    return joined(
        f"CPU {quantity(compute.cpu_percent, '%', 0)}",
        "" if temperature is None else quantity(temperature, "°C", 0),
        "slowed down by heat" if compute.thermal_throttled else "",
        f"memory {gibibytes(compute.ram_used_bytes)} of {gibibytes(compute.ram_total_bytes)}",
        "" if disk is None else f"disk {quantity(disk, '%', 0)}",
    )


def _network(network: Network) -> str:
    signal = network.wifi_signal_dbm
    quality = network.link_quality_percent
    return joined(
        network.interface_name or UNKNOWN,
        "connected" if network.connected else "not connected",
        "" if signal is None else f"{signal} dBm",
        "" if quality is None else f"link quality {quality} %",
    )


def _command(command: EffectiveCommand) -> str:
    return joined(
        f"from {command.active_source or 'unknown'}",
        f"forward {signed(command.vx_mps)} m/s",
        f"left {signed(command.vy_mps)} m/s",
        f"turning {signed(command.wz_rad_s)} rad/s",
    )


def _source_rows(status: SystemStatus) -> Iterator[Row]:
    told = {fault.message for fault in status.faults if fault.active}
    for source in status.sources:
        # What comes has a line of its own, and what is a fault has one, too.
        if source.state is not SourceState.RECEIVING and source.detail not in told:
            mark = source.state.value.replace("_", " ")
            yield Row("source", mark, Tone.QUIET, source.detail or source.name, age(source.age_ms))


def _gateway_rows(gateway: GatewayFacts) -> Iterator[Row]:
    # A gateway that does not say how long it has been running says nothing of itself.
    if gateway.uptime_ms is None:
        return
    text = joined(
        plural(gateway.client_count, "client"),
        plural(gateway.requests_served, "answer"),
        plural(gateway.requests_refused, "refusal") if gateway.requests_refused else "",
        f"revision {gateway.revision[:12]}" if gateway.revision else "",
    )
    yield Row("gateway", "up", Tone.QUIET, text, age(gateway.uptime_ms))


def _teleop_rows(teleop: Teleop) -> Iterator[Row]:
    # A gateway without teleoperation says nothing of it.
    if teleop.state is TeleopState.UNKNOWN:
        return
    limits = (
        f"at most {quantity(teleop.max_linear_mps, 'm/s')}, {quantity(teleop.max_angular_rad_s, 'rad/s')}"
    )
    tone = Tone.GOOD if teleop.enabled else Tone.QUIET
    newest = age(teleop.last_command.age_ms)
    yield Row("teleop", teleop.state.value.upper(), tone, joined(limits, teleop.last_error), newest)
