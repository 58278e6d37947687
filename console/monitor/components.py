"""Formats the status by component: one line each with a mark, the values and their age."""

from collections.abc import Iterator
from dataclasses import dataclass

from console.client import OverlaySnapshot, SystemStatus
from console.client.results import (
    Battery,
    Compute,
    Detections,
    EffectiveCommand,
    Freshness,
    Network,
    Odometry,
    PreviewMeasurement,
    Sample,
    Source,
    SourceState,
    TeleopState,
    Vision,
)
from console.monitor.monitor_state import MonitorState
from console.tone import Tone
from console.words import age, joined, plural, quantity, signed

_MARKS = {
    Freshness.FRESH: ("fresh", Tone.GOOD),
    Freshness.STALE: ("STALE", Tone.WARNING),
    Freshness.MISSING: ("no data", Tone.QUIET),
}


@dataclass(frozen=True, slots=True)
class Component:
    """One line of the status.

    Args:
        name: the part of the robot.
        mark: "fresh", "STALE" or "no data": the meaning of the colour, in a word.
        tone: colour and shape of the line.
        values: the known values, with units.
        age: their age.
    """

    name: str
    mark: str
    tone: Tone
    values: str
    age: str


def components(state: MonitorState, now_s: float) -> list[Component]:
    """Returns all lines, in the order of an operator's interest; empty before the first snapshot."""
    if state.snapshot is None:
        return []
    lines = _Lines(state.snapshot_age_ms(now_s), state.outdated(now_s))
    status = state.snapshot.status
    return [
        *lines.always(state.snapshot),
        *lines.where_there_is_something(status),
        *lines.without_an_age(status),
        *(lines.source(source) for source in status.sources if _worth_a_line(source)),
    ]


class _Lines:
    """Formats samples, whose ages grow by the age of their snapshot."""

    def __init__(self, snapshot_age_ms: int, outdated: bool) -> None:
        self._snapshot_age_ms = snapshot_age_ms
        self._outdated = outdated

    def always(self, snapshot: OverlaySnapshot) -> Iterator[Component]:
        status = snapshot.status
        configured = {source.name for source in status.sources}
        yield self._of("Motion", status.odometry, _motion(status.odometry))
        yield self._of("Vision", status.vision, _vision(status.vision))
        if not configured or "detections" in configured:
            yield self._of("Objects", snapshot.detections, _detections(snapshot.detections))
        yield self._of(
            "Battery", status.platform.power.lipo_battery, _battery(status.platform.power.lipo_battery)
        )

    def where_there_is_something(self, status: SystemStatus) -> Iterator[Component]:
        """Yields lines only for what this robot reports."""
        platform = status.platform
        onboard = platform.power.onboard_battery
        offered: tuple[tuple[str, Sample, str], ...] = (
            ("Command", status.effective_command, _command(status.effective_command)),
            ("Mode", status.mission, status.mission.mode or ""),
            ("Computer", platform.compute, _compute(platform.compute)),
            ("Its battery", onboard, _battery(onboard)),
            ("Network", platform.network, _network(platform.network)),
            ("Video", status.preview.measured, _video(status.preview.measured)),
        )
        for name, sample, values in offered:
            if sample.available:
                yield self._of(name, sample, values)

    def without_an_age(self, status: SystemStatus) -> Iterator[Component]:
        """Yields lines about the robot's set-up."""
        teleop, gateway = status.teleop, status.gateway
        if teleop.state is not TeleopState.UNKNOWN:
            turning = quantity(teleop.max_angular_rad_s, "rad/s")
            limits = _unbroken(f"at most {quantity(teleop.max_linear_mps, 'm/s')}, {turning}")
            tone = Tone.GOOD if teleop.enabled else Tone.QUIET
            yield Component("Teleop", teleop.state.value, tone, joined(limits, teleop.last_error), "")
        if status.insecure:
            risk = "not encrypted, anyone on the network can switch the preview"
            yield Component("Access", "OPEN", Tone.WARNING, risk, "")
        if gateway.uptime_ms is not None and not self._outdated:
            clients = plural(gateway.client_count, "client")
            yield Component(
                "Gateway", "up", Tone.QUIET, clients, age(gateway.uptime_ms + self._snapshot_age_ms)
            )

    def source(self, source: Source) -> Component:
        tone = Tone.WARNING if source.required else Tone.QUIET
        return Component(
            source.name.replace("_", " ").capitalize(), "no data", tone, source.detail, self._age(source)
        )

    def _of(self, name: str, sample: Sample, values: str) -> Component:
        freshness = sample.freshness
        if freshness is Freshness.FRESH and self._outdated:
            freshness = Freshness.STALE
        mark, tone = _MARKS[freshness]
        return Component(name, mark, tone, _unbroken(values) if sample.available else "", self._age(sample))

    def _age(self, sample: Sample) -> str:
        return "" if sample.age_ms is None else age(sample.age_ms + self._snapshot_age_ms)


def _unbroken(values: str) -> str:
    """Returns the same with no-break spaces, so that a line never ends between a number and its unit."""
    return ", ".join(part.replace(" ", "\u00a0") for part in values.split(", "))


def _worth_a_line(source: Source) -> bool:
    """Whether the source can never deliver; one that is merely silent shows in its own line as stale."""
    return source.state in (SourceState.QOS_MISMATCH, SourceState.WRONG_TYPE, SourceState.TYPE_MISSING)


def _motion(odometry: Odometry) -> str:
    return joined(quantity(odometry.linear_speed_mps, "m/s", 2), f"turning {signed(odometry.wz_rad_s)} rad/s")


def _vision(vision: Vision) -> str:
    errors = (vision.infer_error_count or 0) + (vision.capture_fatal_error_count or 0)
    return joined(
        quantity(vision.consumer_fps, "fps"),
        f"inference {quantity(vision.last_infer_ms, 'ms')}",
        plural(errors, "error") if errors else "",
    )


def _detections(detections: Detections) -> str:
    return plural(detections.count, "object")


def _battery(battery: Battery) -> str:
    if battery.present is False:
        return "not in its place"
    charging = {True: "charging", False: "discharging", None: ""}[battery.charging]
    voltage = "" if battery.voltage_v is None else quantity(battery.voltage_v, "V")
    return joined(quantity(battery.charge_percent, "%", 0), voltage, charging)


def _command(command: EffectiveCommand) -> str:
    return joined(
        command.active_source or "unknown",
        f"{signed(command.vx_mps)} m/s",
        f"{signed(command.wz_rad_s)} rad/s",
    )


def _compute(compute: Compute) -> str:
    temperature = compute.cpu_temperature_c
    return joined(
        f"CPU {quantity(compute.cpu_percent, '%', 0)}",
        "" if temperature is None else quantity(temperature, "°C", 0),
        "slowed by heat" if compute.thermal_throttled else "",
        f"memory {quantity(compute.ram_used_percent, '%', 0)}",
        "" if compute.disk_used_percent is None else f"disk {quantity(compute.disk_used_percent, '%', 0)}",
    )


def _network(network: Network) -> str:
    signal = network.wifi_signal_dbm
    return joined(
        network.interface_name or "",
        "connected" if network.connected else "not connected",
        "" if signal is None else f"{signal} dBm",
    )


def _video(measured: PreviewMeasurement) -> str:
    return joined(
        quantity(measured.fps, "fps", 0),
        quantity(measured.bitrate_kbps, "kbit/s", 0),
        plural(measured.viewer_count, "viewer"),
        "" if not measured.worst_loss_percent else f"loss {quantity(measured.worst_loss_percent, '%')}",
    )
