"""The text of each measured part of a status: its values, in the order of an operator's interest.

Compact texts have room for what an operator looks at first.
"""

from typing import Final

from console.client import results
from console.client.results import FixStatus
from console.presentation.formatting import UNKNOWN, bit_rate, gibibytes, joined, plural, quantity, signed

_MOST_DECIMALS: Final = 9
"""As the gateway's configuration allows; another gateway may send anything."""
_LARGE: Final = 1e15
"""A binary64 has no digits behind the point from about here on."""


def motion_text(odometry: results.Odometry, compact: bool) -> str:
    """Returns the speeds, in m/s and rad/s."""
    return joined(
        quantity(odometry.linear_speed_mps, "m/s", 2),
        "" if compact else f"forward {signed(odometry.vx_mps)} m/s",
        "" if compact else f"left {signed(odometry.vy_mps)} m/s",
        f"turning {signed(odometry.wz_rad_s)} rad/s",
    )


def vision_text(vision: results.Vision, compact: bool) -> str:
    """Returns how the robot's own detector does: frames per second, inference in ms, errors."""
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


def battery_text(battery: results.Battery, compact: bool) -> str:
    """Returns charge, voltage, and whether it is being charged."""
    if battery.present is False:
        return "not installed"
    return joined(
        quantity(battery.charge_percent, "%", 0),
        "" if compact and battery.voltage_v is None else quantity(battery.voltage_v, "V"),
        {True: "charging", False: "discharging", None: ""}[battery.charging],
        "" if compact else battery.source or "",
    )


def command_text(command: results.EffectiveCommand, compact: bool) -> str:
    """Returns the velocities that are in effect, and their source."""
    source = command.active_source or "unknown"
    forward, turning = f"{signed(command.vx_mps)} m/s", f"{signed(command.wz_rad_s)} rad/s"
    if compact:
        return joined(source, forward, turning)
    left = f"left {signed(command.vy_mps)} m/s"
    return joined(f"from {source}", f"forward {forward}", left, f"turning {turning}")


def compute_text(compute: results.Compute, compact: bool) -> str:
    """Returns the load of the robot's computer."""
    temperature, disk = compute.cpu_temperature_c, compute.disk_used_percent
    used, total = gibibytes(compute.ram_used_bytes), gibibytes(compute.ram_total_bytes)
    return joined(
        f"CPU {quantity(compute.cpu_percent, '%', 0)}",
        "" if temperature is None else quantity(temperature, "°C", 0),
        "throttled by heat" if compute.thermal_throttled else "",
        f"memory {quantity(compute.ram_used_percent, '%', 0) if compact else f'{used} of {total}'}",
        "" if disk is None else f"disk {quantity(disk, '%', 0)}",
    )


def network_text(network: results.Network, compact: bool) -> str:
    """Returns the link of the robot's network interface."""
    signal, quality = network.wifi_signal_dbm, network.link_quality_percent
    return joined(
        network.interface_name or ("" if compact else UNKNOWN),
        "connected" if network.connected else "not connected",
        "" if signal is None else f"{signal} dBm",
        "" if compact or quality is None else f"link quality {quality} %",
    )


def position_text(position: results.Position, compact: bool) -> str:
    """Returns latitude and longitude in degrees (WGS 84), with accuracy and altitude in m."""
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


def attitude_text(orientation: results.Orientation, _compact: bool) -> str:
    """Returns roll, pitch and yaw in degrees; the same in both densities."""
    angles = {"roll": orientation.roll_deg, "pitch": orientation.pitch_deg, "yaw": orientation.yaw_deg}
    if orientation.roll_deg is None:
        return UNKNOWN if orientation.available else ""
    return joined(*(f"{name} {signed(angle, 1)}°" for name, angle in angles.items()))


def video_text(measured: results.PreviewMeasurement, compact: bool, target_kbps: int = 0) -> str:
    """Returns the stream's figures; in full beside the bit rate that it should have."""
    rtt_ms, loss_percent = measured.worst_rtt_ms, measured.worst_loss_percent
    picture_age_ms = measured.worst_picture_age_ms
    late, given_up = measured.srt_latency_viewer_count, measured.most_packets_given_up
    return joined(
        bit_rate(measured.bitrate_kbps) + ("" if compact else f" of {bit_rate(target_kbps)}"),
        quantity(measured.fps, "fps"),
        plural(measured.viewer_count, "viewer"),
        "" if compact or rtt_ms is None else f"round trip {quantity(rtt_ms, 'ms')}",
        ""
        if loss_percent is None or (compact and not loss_percent)
        else f"loss {quantity(loss_percent, '%')}",
        "" if compact or picture_age_ms is None else f"picture {quantity(picture_age_ms, 'ms', 0)} old",
        "" if compact or not late else f"{plural(late, 'viewer')} at SRT latency",
        "" if compact or not given_up else f"{plural(given_up, 'packet')} given up",
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
