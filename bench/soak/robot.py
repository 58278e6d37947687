"""Two hours of a whole robot, with operators, viewers, drivers, recordings and faults that come and go.

A round is what several people do with a robot in some seconds, beside one fault; the faults take turns. What
a program keeps of what has ended adds up (readings.py). A round in which an operator does not get what was
asked for counts as failed, and its reason is logged.
"""

import asyncio
import shutil
import time
from itertools import cycle
from typing import Final

import psutil

from bench.progress import log
from bench.rows import MeasurementError, Row
from bench.soak.deployment import ARM, PASSING, STEADY, Deployment, deployment
from bench.soak.faults import FAULTS, Fault
from bench.soak.operators import come_and_go
from bench.soak.readings import FEWEST_ROUNDS, Reading, judge_together
from console.client import AsyncGatewayClient, GatewayClient, GatewayError, PreviewProfile, PreviewState
from console.receiver.errors import StreamError
from tests.support.driven_robot import BY_EYE, in_motion, is_at_rest
from tests.support.eventually import eventually
from tests.support.receiver import Receiver

MINUTES: Final = 120.0
OPERATORS: Final = 3
SPEED_MPS: Final = 0.1
FRAME_WITHIN_S: Final = 10.0
_PROFILES: Final = (PreviewProfile.LOW_BW, PreviewProfile.BALANCED, PreviewProfile.HIGH_QUALITY)
_LOG_EVERY_ROUNDS: Final = 20


def rows(_ground: None, wanted: set[str], minutes: float = MINUTES) -> list[Row]:
    readings: list[dict[str, Reading]] = []
    failed_rounds = 0
    with deployment() as robot:
        until_s = time.monotonic() + minutes * 60
        for profile, fault in zip(cycle(_PROFILES), cycle(FAULTS)):
            try:
                one_round(robot, profile, fault)
            except (GatewayError, StreamError, AssertionError, TimeoutError) as error:
                failed_rounds += 1
                what = f"{type(error).__name__}: {error}"
                log(f"soak.robot: round {len(readings) + 1}, {fault.__name__}: {what}")
            try:
                readings.append(robot.readings())
            except (OSError, psutil.Error, AssertionError) as error:
                # What has been read so far is judged all the same.
                log(f"soak.robot: the run ends in round {len(readings) + 1}: a program has ended ({error})")
                failed_rounds += 1
                break
            if len(readings) % _LOG_EVERY_ROUNDS == 0:
                _log(len(readings), readings[-1])
            if time.monotonic() >= until_s and len(readings) >= FEWEST_ROUNDS:
                break
    if len(readings) < FEWEST_ROUNDS:
        raise MeasurementError(f"the long run has ended after {len(readings)} rounds, too few to judge")
    rounds = f"operators, a viewer, a driver, a recording and a fault in {minutes:g} min"
    made = judge_together(readings, failed_rounds, "soak.robot_", rounds)
    return [row for row in made if row.name in wanted]


def one_round(robot: Deployment, profile: PreviewProfile, fault: Fault) -> None:
    """What people do with a robot, beside a fault.

    Raises:
        GatewayError: of what an operator called.
        StreamError: a viewer got no frame.
        AssertionError: something that had to happen did not.
    """
    with GatewayClient(robot.target) as client, fault(robot, client):
        come_and_go(robot.target, OPERATORS)
        _watch(robot, client, profile)
        asyncio.run(_drive_and_record(robot))


def _watch(robot: Deployment, client: GatewayClient, profile: PreviewProfile) -> None:
    """One viewer stays while the camera changes to one that ends by itself, and to a ROS topic."""
    change = client.enable_preview(profile, camera=STEADY)
    assert change.preview.state is PreviewState.RUNNING, change.message
    try:
        with Receiver(robot.stream) as staying:
            staying.next_frame(FRAME_WITHIN_S)
            for camera in (PASSING, ARM):
                client.enable_preview(camera=camera)
                with Receiver(robot.stream) as passing:
                    passing.next_frame(FRAME_WITHIN_S)
                staying.next_frame(FRAME_WITHIN_S)
    finally:
        client.disable_preview()


async def _drive_and_record(robot: Deployment) -> None:
    """A driver moves the robot for a moment while it is recorded; the recording is fetched and deleted."""
    async with AsyncGatewayClient(robot.target) as client:
        made = (await client.start_recording("soak")).recording
        async with client.drive(BY_EYE) as session:
            await in_motion(client, session, robot.base, SPEED_MPS)
            session.release()
            await eventually(lambda: is_at_rest(robot.base), bool, "the base is at rest")
        await client.stop_recording(made.id)
        folder = robot.directory / "exported"
        await client.export_recording(made.id, folder)
        shutil.rmtree(folder)
        await client.delete_recording(made.id)


def _log(rounds: int, newest: dict[str, Reading]) -> None:
    figures = "; ".join(
        f"{name} {r.resident_mib:.1f} MiB, {r.descriptors} descriptors, {r.threads} threads"
        for name, r in newest.items()
    )
    log(f"soak.robot: round {rounds}: {figures}")
