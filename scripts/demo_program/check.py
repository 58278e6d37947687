"""The main job, once, from status to video and back: one line per step with the measured time."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from common.errors import UserError
from console.client import (
    DriveOptions,
    DrivePhase,
    GatewayClient,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
    Supervision,
    SystemStatus,
)
from console.client.blocking import BlockingDriveSession
from console.client.results import Freshness
from console.receiver.address import StreamAddress
from demo_program.ground import Ground
from demo_program.programs import Programs
from demo_program.ready import status_or_none, wait_until_up
from simrobot.control import ask
from tests.support.free import udp_port_is_free
from tests.support.receiver import Receiver

FRAMES: Final = 60
_SPEEDS_MPS: Final = (0.2, 0.1)
_DRIVEN_MPS: Final = -0.1
"""Backward: by itself the robot only drives forward."""
_HOLDS: Final = 5
_FOLLOWS_WITHIN_S: Final = 4.0
_TOLERANCE_MPS: Final = 0.01
_SEEN_WITHIN_S: Final = 10.0
_PREVIEW_WITHIN_S: Final = 20.0
_FIRST_FRAME_WITHIN_S: Final = 15.0
_FRAME_WITHIN_S: Final = 3.0
# libsrt gives a port back 3 to 5 s after its listener was closed, as measured, whichever peer was connected.
_FREE_WITHIN_S: Final = 15.0

Say = Callable[[str], None]


def check(ground: Ground, programs: Programs, began_s: float) -> None:
    """Raises UserError at the first step that fails; the step's line says so."""
    print(f"ok   {time.monotonic() - began_s:6.2f} s  setup: the environment is complete", flush=True)
    with GatewayClient(ground.target) as robot:
        with _step("start", programs) as say:
            wait_until_up(ground, programs, robot)
            say(f"{', '.join(programs.pids())} are up (gRPC {ground.grpc_port}, ROS domain {ground.domain})")
        with _step("status", programs) as say:
            say(_fresh(programs, robot))
        with _step("values", programs) as say:
            say(_values_follow(ground, programs, robot))
        with _step("silence", programs) as say:
            say(_silence_is_seen(ground, programs, robot))
        with _step("drive", programs) as say:
            say(_drives_and_stops(programs, robot))
        with _step("preview on", programs) as say:
            preview = _preview_on(robot)
            say(_preview_in_words(preview))
        # PyGObject does not survive an exception out of a signal handler. Each wait there is bounded.
        with _step("video", programs) as say, programs.interruption.deferred():
            say(_video(preview))
        with _step("preview off", programs) as say:
            say(_preview_off(ground, programs, robot))
    with _step("stop", programs) as say:
        programs.stop()
        say("all programs ended in good order")


@contextmanager
def _step(name: str, programs: Programs) -> Iterator[Say]:
    began_s = time.monotonic()
    seen: list[str] = []
    try:
        yield seen.append
        programs.check_alive()
    except UserError as error:
        print(f"FAIL {time.monotonic() - began_s:6.2f} s  {name}: {error.what}", flush=True)
        raise
    print(f"ok   {time.monotonic() - began_s:6.2f} s  {name}: {'; '.join(seen)}", flush=True)


def _fresh(programs: Programs, robot: GatewayClient) -> str:
    status = programs.wait_until(lambda: _if_healthy(robot), _SEEN_WITHIN_S, lambda: _health_seen(robot))
    odometry, vision = status.odometry, status.vision
    return (
        f"{status.health.summary}; odometry {odometry.age_ms} ms old, vision {vision.age_ms} ms old, "
        f"{odometry.linear_speed_mps:.2f} m/s, {vision.consumer_fps:.1f} fps evaluated"
    )


def _if_healthy(robot: GatewayClient) -> SystemStatus | None:
    status = status_or_none(robot)
    fresh = (
        status
        and status.health.ready
        and status.odometry.freshness is Freshness.FRESH
        and status.vision.freshness is Freshness.FRESH
    )
    return status if fresh else None


def _health_seen(robot: GatewayClient) -> str:
    return f"fresh odometry and vision; the gateway says '{robot.status().health.summary}'"


def _values_follow(ground: Ground, programs: Programs, robot: GatewayClient) -> str:
    return "; ".join(_value_follows(ground, programs, robot, speed_mps) for speed_mps in _SPEEDS_MPS)


def _value_follows(ground: Ground, programs: Programs, robot: GatewayClient, speed_mps: float) -> str:
    ask(ground.control_socket, {"speed_mps": speed_mps})
    began_s = time.monotonic()

    def what_is_seen() -> str:
        return f"the robot drives {speed_mps} m/s, status says {robot.status().odometry.linear_speed_mps}"

    programs.wait_until(lambda: _if_speed(robot, speed_mps), _SEEN_WITHIN_S, what_is_seen)
    return f"robot set to {speed_mps} m/s, status shows it after {(time.monotonic() - began_s) * 1000:.0f} ms"


def _if_speed(robot: GatewayClient, speed_mps: float) -> SystemStatus | None:
    status = status_or_none(robot)
    seen = status.odometry.linear_speed_mps if status else None
    return status if seen is not None and abs(seen - speed_mps) <= _TOLERANCE_MPS else None


def _silence_is_seen(ground: Ground, programs: Programs, robot: GatewayClient) -> str:
    ask(ground.control_socket, {"silent": ["odometry"]})
    stale = programs.wait_until(
        lambda: _if_odometry_stale(robot), _SEEN_WITHIN_S, "silent odometry reads stale"
    )
    ask(ground.control_socket, {"silent": []})
    programs.wait_until(lambda: _if_healthy(robot), _SEEN_WITHIN_S, lambda: _health_seen(robot))
    return (
        f"odometry silenced: '{stale.health.summary}' at {stale.odometry.age_ms} ms; resumed: healthy again"
    )


def _if_odometry_stale(robot: GatewayClient) -> SystemStatus | None:
    status = status_or_none(robot)
    return status if status and status.odometry.stale and not status.health.ready else None


def _drives_and_stops(programs: Programs, robot: GatewayClient) -> str:
    options = DriveOptions(supervision=Supervision.LINE_OF_SIGHT, input_device="scripts/demo")
    with robot.drive(options) as session:
        # A machine that is too busy ends a hold; another one may begin.
        if not any(_follows(programs, robot, session) for _ in range(_HOLDS)):
            raise UserError(f"the robot does not follow its driver: {session.reasons()}")
        began_s = time.monotonic()
        stopped = robot.stop_robot("end of the drive")
        confirmed_s = time.monotonic() - began_s
        programs.wait_until(
            lambda: _if_stopped(robot), _SEEN_WITHIN_S, "the robot stands still, and its status says why"
        )
        # While there is a driver: without one the reset is refused, as autonomy would have the robot again.
        robot.reset_stop(stopped.stop.stop_id)
    return (
        f"back at {-_DRIVEN_MPS} m/s while the driver held, by the base's odometry; "
        f"StopRobot confirmed after {confirmed_s * 1000:.0f} ms, and reset"
    )


def _follows(programs: Programs, robot: GatewayClient, session: BlockingDriveSession) -> bool:
    """Holds until the base follows; False if it does not in time."""
    if stop := robot.status().teleop.stop:
        robot.reset_stop(stop.stop_id)
    session.ready(_SEEN_WITHIN_S)
    until_s = time.monotonic() + _FOLLOWS_WITHIN_S

    def look() -> bool | None:
        session.hold(_DRIVEN_MPS)
        if _is_driven(robot):
            return True
        return False if time.monotonic() > until_s else None

    try:
        return programs.wait_until(look, 2 * _FOLLOWS_WITHIN_S, "the robot follows its driver")
    finally:
        session.release()


def _is_driven(robot: GatewayClient) -> bool:
    status = status_or_none(robot)
    seen = status.odometry.vx_mps if status else None
    return seen is not None and abs(seen - _DRIVEN_MPS) <= _TOLERANCE_MPS


def _if_stopped(robot: GatewayClient) -> SystemStatus | None:
    status = status_or_none(robot)
    stopped = status and status.teleop.phase is DrivePhase.STOPPED and status.odometry.linear_speed_mps == 0.0
    return status if stopped else None


def _preview_on(robot: GatewayClient) -> PreviewStatus:
    change = robot.enable_preview(PreviewProfile.BALANCED, settle_within_s=_PREVIEW_WITHIN_S)
    preview = change.preview
    if preview.state is not PreviewState.RUNNING:
        raise UserError(f"the preview is {preview.state.value}: {preview.last_error or change.message}")
    if preview.endpoint is None:
        raise UserError("the preview runs, but the gateway does not say where")
    return preview


def _preview_in_words(preview: PreviewStatus) -> str:
    uri = preview.endpoint.uri if preview.endpoint else ""
    encoder = preview.encoder.name if preview.encoder else "unknown"
    return f"{preview.profile.value} is running at {uri}, encoder {encoder}"


def _video(preview: PreviewStatus) -> str:
    assert preview.endpoint  # noqa: S101  # a running preview has one
    address = StreamAddress(
        preview.endpoint.host, preview.endpoint.port, preview.endpoint.latency_ms, preview.endpoint.passphrase
    )
    began_s = time.monotonic()
    pictures = set()
    # Every picture of the run is wanted, so that the receiver must not throw any away.
    with Receiver(address, queue_size=FRAMES) as receiver:
        frame = receiver.next_frame(_FIRST_FRAME_WITHIN_S)
        first_s = time.monotonic() - began_s
        pictures.add(hash(frame.read()))
        for _ in range(FRAMES - 1):
            frame = receiver.next_frame(_FRAME_WITHIN_S)
            pictures.add(hash(frame.read()))
    if len(pictures) == 1:
        raise UserError(f"{FRAMES} frames came, but they all show the same picture")
    return (
        f"{FRAMES} frames of {frame.width}x{frame.height} {frame.codec} received over SRT and decoded, "
        f"{len(pictures)} different pictures, the first after {first_s * 1000:.0f} ms"
    )


def _preview_off(ground: Ground, programs: Programs, robot: GatewayClient) -> str:
    # Against the case that the port was never bound: then being free at the end would prove nothing.
    if udp_port_is_free(ground.srt_port):
        raise UserError(f"UDP port {ground.srt_port} is not bound although the preview runs")
    change = robot.disable_preview(settle_within_s=_PREVIEW_WITHIN_S)
    if change.preview.state is not PreviewState.DISABLED:
        raise UserError(f"the preview is {change.preview.state.value}: {change.message}")
    programs.wait_until(
        lambda: udp_port_is_free(ground.srt_port) or None,
        _FREE_WITHIN_S,
        f"UDP port {ground.srt_port} is free again",
    )
    return f"disabled, UDP port {ground.srt_port} is free again"
