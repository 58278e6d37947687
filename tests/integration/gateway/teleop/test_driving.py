"""Driving with real parts: client library, gateway, drive program, and a subscriber in the base's place.

One robot serves all tests of a module: each begins with a driver's own session and ends without one.
"""

import asyncio
import socket
import struct
import threading
import time
import uuid
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack
from dataclasses import replace
from itertools import chain, repeat
from typing import Any

import grpc
import pytest

from common.reasons import Reason
from common.ros_node import message_class, ros_node
from console.client import (
    AsyncGatewayClient,
    CaughtUp,
    DriveInhibit,
    DriveOptions,
    DrivePhase,
    DriveSession,
    Event,
    GatewayError,
    Overloaded,
    Refused,
)
from console.client.drive_lanes import LANES
from console.client.error_table import error_from
from console.client.options import ClientOptions
from console.client.transport import GrpcTransport
from console.credentials import Credentials
from omniseer.gateway.v1 import robot_gateway_pb2, teleop_pb2
from omniseer.gateway.v1.teleop_pb2_grpc import TeleopServiceStub
from tests.support.driven_robot import (
    BY_EYE,
    DrivenRobot,
    anew_after_a_loss,
    free,
    held,
    in_motion,
    is_at_rest,
    may_be_driven,
    was_held,
)
from tests.support.driving import Observer
from tests.support.eventually import eventually
from tests.support.own_connections import all_closed, nothing_collected, own_connections
from tests.support.promise import keeps_async
from tests.support.relay import Relay
from tests.support.running_gateway import raw_unary
from tests.support.undisturbed import no_stall

# Timed: on a machine that is busy with other tests, a hold lapses, and only a new one moves the robot again.
pytestmark = [pytest.mark.ros, pytest.mark.timed]
SPEED_MPS = 0.1
PATIENCE_S = 20


@pytest.fixture
async def client(robot: DrivenRobot) -> AsyncIterator[AsyncGatewayClient]:
    async with AsyncGatewayClient(robot.target) as client:
        yield client
        # What a test leaves behind must not stop the next one.
        await free(robot)


@pytest.fixture
def observer(robot: DrivenRobot) -> Iterator[Observer]:
    """The drive program's own word."""
    observer = Observer(robot.drive.socket)
    yield observer
    observer.close()


async def teleop_of(client: AsyncGatewayClient) -> Any:
    return (await client.status()).teleop


async def in_phase(session: DriveSession, phase: DrivePhase) -> None:
    async def present() -> DrivePhase | None:
        session.check()
        return session.state.phase if session.state else None

    await eventually(present, lambda seen: seen is phase, phase.value)


async def comes_to_rest(robot: DrivenRobot) -> None:
    """The robot's answer may overtake what it published: that comes by another thread of this process."""
    await eventually(lambda: is_at_rest(robot.base), bool, "the base is at rest")


async def test_a_session_that_has_ended_leaves_no_connection(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    port = int(robot.target.rpartition(":")[2])
    await client.status()
    with nothing_collected():
        before = own_connections(port)
        async with client.drive(BY_EYE) as session:
            opened, lanes = own_connections(port) - before, session.open_lanes
        assert len(opened) >= lanes > 0
        await all_closed(port, opened)


async def test_every_time_of_motion_is_an_event(robot: DrivenRobot, client: AsyncGatewayClient) -> None:
    """The first here: of many times of motion of one caller within minutes, later ones share an event."""
    async with client.drive(BY_EYE) as session:
        await in_motion(client, session, robot.base, SPEED_MPS)
        session.release()
        await in_phase(session, DrivePhase.ARMED)

    async def released() -> list[str]:
        messages = [each.message for each in await newest_events(client)]
        return [each for each in messages if "deg, by test" in each and each.endswith("released")]

    found = await eventually(released, bool, "an event of the motion")
    assert " m, " in found[-1]


@anew_after_a_loss
async def test_a_hold_moves_the_robot_and_a_release_stops_it(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    async with client.drive(BY_EYE) as session:
        assert session.limits is not None
        await in_motion(client, session, robot.base, SPEED_MPS)
        with no_stall():
            async with held(session, SPEED_MPS):
                await in_phase(session, DrivePhase.DRIVING)
                teleop = await teleop_of(client)
                was_held(session)
            assert (teleop.phase, teleop.holder, teleop.stop) == (DrivePhase.DRIVING, "127.0.0.1", None)
        session.release()
        await in_phase(session, DrivePhase.ARMED)
        await comes_to_rest(robot)
    await eventually(lambda: teleop_of(client), lambda it: not it.holder, "no one drives any more")
    assert not robot.base.moves, "the last message is zero"
    assert all(abs(each.vx_mps) <= SPEED_MPS + 1e-6 for each in robot.base.heard)


@anew_after_a_loss
async def test_a_session_that_is_left_by_an_error_stops_the_robot(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    async def fails() -> None:
        async with client.drive(BY_EYE) as session:
            await in_motion(client, session, robot.base, SPEED_MPS)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fails()
    await comes_to_rest(robot)
    assert (await teleop_of(client)).stop is None, "that was a release, not a loss"


async def test_a_reset_that_is_refused_names_the_other_source(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    twist_stamped = message_class("geometry_msgs/msg/TwistStamped")

    async def plan(publisher: Any) -> None:
        message = twist_stamped()
        message.twist.linear.x = SPEED_MPS
        while True:
            publisher.publish(message)
            await asyncio.sleep(0.05)

    async def moved_for_a_second() -> bool:
        return sum(each.moves for each in robot.base.heard[heard:]) >= 20

    async def resets() -> str:
        teleop = await teleop_of(client)
        try:
            await client.reset_stop(teleop.stop.stop_id)
        except Refused as error:
            return f"{error.reason}: {error}"
        return ""

    heard = len(robot.base.heard)
    with ros_node("planner") as planner:
        planning = asyncio.create_task(plan(planner.create_publisher(twist_stamped, "/cmd_vel_nav", 1)))
        await eventually(moved_for_a_second, bool, "the planner moves the robot")
        await client.stop_robot()
        # At first the drive program may not hear the planner yet, and refuses without a name.
        named = "another source commands motion on /cmd_vel_nav"
        refused = await eventually(resets, lambda said: not said or named in said, "it is named")
        assert refused.startswith(Reason.STOP_NOT_RESET)
        planning.cancel()
    await eventually(resets, lambda said: not said, "the other source is silent")
    await eventually(lambda: teleop_of(client), lambda it: not it.stop, "the status shows it")


@anew_after_a_loss
async def test_hands_that_no_longer_report_are_a_release(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    async with client.drive(BY_EYE) as session:
        await in_motion(client, session, robot.base, SPEED_MPS)
        # From here on the program holds no more, and does not release either.
        await in_phase(session, DrivePhase.ARMED)
        await comes_to_rest(robot)


@anew_after_a_loss
async def test_anyone_may_stop_and_only_that_stop_is_reset(
    robot: DrivenRobot, client: AsyncGatewayClient, observer: Observer
) -> None:
    async def obstacle() -> str:
        return observer.now().reset_obstacle

    async with client.drive(BY_EYE) as session:
        await in_motion(client, session, robot.base, SPEED_MPS)
        stopped = await client.stop_robot("a child on the track")
        assert stopped.stop.reason == "a child on the track"
        await comes_to_rest(robot)
        again = await client.stop_robot("again")
        assert again.stop.stop_id > stopped.stop.stop_id, "perhaps of another person with the same credential"
        with pytest.raises(Refused) as refused:
            await client.reset_stop(stopped.stop.stop_id)
        assert refused.value.reason == Reason.STOP_NOT_RESET
        await in_phase(session, DrivePhase.STOPPED)
        session.release()  # The hold has lapsed meanwhile.
        async with held(session, SPEED_MPS):
            await eventually(obstacle, lambda it: "the driver holds" in it, "the hold has arrived")
            for stop_id in (again.stop.stop_id, again.stop.stop_id + 1):
                # While the driver holds; and not the stop that there is.
                with pytest.raises(Refused) as refused:
                    await client.reset_stop(stop_id)
                assert refused.value.reason == Reason.STOP_NOT_RESET
        session.release()
        await eventually(obstacle, lambda it: not it, "the release has arrived")
        await client.reset_stop(again.stop.stop_id)
        await in_phase(session, DrivePhase.ARMED)
        assert not robot.base.moves
        # Released meanwhile, so a new hold moves it again.
        await in_motion(client, session, robot.base, SPEED_MPS)


async def is_reset(client: AsyncGatewayClient, stop_id: int) -> bool:
    try:
        await client.reset_stop(stop_id)
    except Refused:  # A worker that has just taken a lost one's place does not know what else commands.
        return False
    return True


@anew_after_a_loss
async def test_a_late_copy_of_a_stop_stops_nothing_anew_after_the_reset(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    """A client sends each stop on two connections; the slower copy may come after the stop was reset."""
    async with grpc.aio.insecure_channel(robot.target) as channel:
        stub = TeleopServiceStub(channel)
        request = teleop_pb2.StopRobotRequest(reason="a child", request_id=uuid.uuid4().hex)
        first = await stub.StopRobot(request)
        await eventually(lambda: is_reset(client, first.stop.stop_id), bool, "it is reset")
        copy = await stub.StopRobot(request)
        assert copy.stop.stop_id == first.stop.stop_id
        assert "reset" in copy.message
        # Another request stops, and so does each that names none.
        newest = first.stop.stop_id
        for another in (uuid.uuid4().hex, "", ""):
            stopped = await stub.StopRobot(teleop_pb2.StopRobotRequest(request_id=another))
            assert stopped.stop.stop_id > newest
            newest = stopped.stop.stop_id
            await eventually(lambda: is_reset(client, newest), bool, "it is reset")  # noqa: B023  # at once


@anew_after_a_loss
async def test_a_lost_driver_leaves_a_stopped_robot(robot: DrivenRobot, client: AsyncGatewayClient) -> None:
    channel = grpc.aio.insecure_channel(robot.target, options=(("grpc.use_local_subchannel_pool", 1),))
    async with channel:
        lane: Any = TeleopServiceStub(channel).Drive()
        supervision = teleop_pb2.SUPERVISION_LINE_OF_SIGHT
        await lane.write(teleop_pb2.DriveRequest(open=teleop_pb2.DriveOpen(supervision=supervision)))
        await lane.read()
        newest: list[Any] = []

        async def read() -> None:
            while (response := await lane.read()) is not grpc.aio.EOF:
                newest[:] = [response.state]

        reading = asyncio.create_task(read())
        await eventually(lambda: _of(newest), bool, "a state")
        for sequence in range(1, 500):
            await lane.write(raw_command(sequence, newest[0], held=sequence > 5))
            await asyncio.sleep(0.02)
            if robot.base.moves:
                break
        assert robot.base.moves
        reading.cancel()
    # The channel is closed: both directions are gone at once.
    teleop = await eventually(lambda: teleop_of(client), lambda it: it.stop is not None, "stopped")
    assert "lost" in teleop.stop.reason
    assert await is_at_rest(robot.base)


async def _of(items: list[Any]) -> int:
    return len(items)


def raw_command(sequence: int, state: Any, *, held: bool) -> Any:
    valid_until_ns = time.monotonic_ns() + 250_000_000
    command = teleop_pb2.DriveCommand(
        sequence=sequence,
        held=held,
        vx_mps=SPEED_MPS,
        echo_monotonic_ns=state.monotonic_ns,
        valid_until_monotonic_ns=valid_until_ns,
    )
    return teleop_pb2.DriveRequest(command=command)


@anew_after_a_loss
async def test_one_lane_may_go(robot: DrivenRobot, client: AsyncGatewayClient) -> None:
    async with client.drive(BY_EYE) as session:
        assert session.open_lanes == LANES, "from the beginning"
        await in_motion(client, session, robot.base, SPEED_MPS)
        # The test's own hand in the library: only there one lane can be cut.
        session._lanes._keepers[1].cancel()
        with no_stall():
            for _ in range(15):
                session.hold(SPEED_MPS)
                await asyncio.sleep(0.02)
            session.check()
            was_held(session)
            assert robot.base.moves


@anew_after_a_loss
async def test_a_lane_that_vanishes_comes_back_and_costs_no_session(
    robot: DrivenRobot, client: AsyncGatewayClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The gateway takes the lane for open for some seconds more than the client."""
    async with Relay(robot.gateway.port) as relay:
        session = client.drive(BY_EYE)
        targets = chain([robot.target, f"127.0.0.1:{relay.port}"], repeat(robot.target))
        monkeypatch.setattr(
            session._lanes, "_connect", lambda: GrpcTransport(next(targets), ClientOptions(), Credentials())
        )

        async def open_lanes() -> int:
            session.check()
            return session.open_lanes

        async with session:
            assert session.open_lanes == LANES
            relay.frozen = True
            await eventually(open_lanes, lambda lanes: lanes == LANES - 1, "the client has noticed")
            await in_motion(client, session, robot.base, SPEED_MPS)
            session.release()
            await eventually(open_lanes, lambda lanes: lanes == LANES, "a new one has its place")


@pytest.fixture
def one_lane(
    robot: DrivenRobot, client: AsyncGatewayClient, monkeypatch: pytest.MonkeyPatch
) -> Iterator[DriveSession]:
    """A session whose connections but the first are accepted, and never answered."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        session = client.drive(BY_EYE)
        targets = iter([robot.target])
        monkeypatch.setattr(
            session._lanes,
            "_connect",
            lambda: GrpcTransport(next(targets, address), ClientOptions(), Credentials()),
        )
        yield session


async def test_a_session_opens_though_its_other_lanes_do_not(
    robot: DrivenRobot, client: AsyncGatewayClient, one_lane: DriveSession
) -> None:
    async with AsyncExitStack() as stack:
        async with asyncio.timeout(PATIENCE_S):
            session = await stack.enter_async_context(one_lane)
        assert session.open_lanes == 1
        await in_motion(client, session, robot.base, SPEED_MPS)


async def test_a_session_given_up_while_it_opens_leaves_no_driver(
    client: AsyncGatewayClient, one_lane: DriveSession
) -> None:
    opening = asyncio.create_task(one_lane.__aenter__())

    async def holder() -> str:
        return (await client.status()).teleop.holder

    await eventually(holder, bool, "the first lane has the lease")
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    await eventually(holder, lambda it: not it, "no one has the lease")


@anew_after_a_loss
async def test_another_driver_waits_or_takes_over(robot: DrivenRobot, client: AsyncGatewayClient) -> None:
    async with AsyncGatewayClient(robot.target) as other, client.drive(BY_EYE) as session:
        await in_motion(client, session, robot.base, SPEED_MPS)
        for take_over in (False, True):
            with pytest.raises(Refused) as refused:
                async with other.drive(replace(BY_EYE, take_over=take_over)):
                    pass
            assert refused.value.reason == Reason.LEASE_HELD
            session.hold(SPEED_MPS)
        session.release()
        taking = replace(BY_EYE, take_over=True)

        async def taken_over() -> bool:
            try:
                async with other.drive(taking) as second:
                    await in_phase(second, DrivePhase.ARMED)
                    return True
            except Refused:
                return False

        await eventually(taken_over, bool, "taken over after 2 s without a hold")
        with pytest.raises(Refused) as ended:
            await eventually(lambda: _checked(session), bool, "the first session has ended")
        assert ended.value.reason == Reason.LEASE_LOST


async def _checked(session: DriveSession) -> bool:
    session.check()
    return False


async def test_without_a_picture_nothing_moves_under_supervision(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    async with client.drive(DriveOptions(picture=time.monotonic_ns)) as session:
        for _ in range(25):
            session.hold(SPEED_MPS)
            await asyncio.sleep(0.02)
        with pytest.raises(Refused, match="no picture"):
            await session.ready(within_s=0.2)
        assert session.state is not None
        assert session.state.inhibits == (DriveInhibit.PICTURE_MISSING,)
        assert not robot.base.moves


@anew_after_a_loss
async def test_disabling_ends_the_session(robot: DrivenRobot, client: AsyncGatewayClient) -> None:
    async with client.drive(BY_EYE) as session:
        await in_motion(client, session, robot.base, SPEED_MPS)
        answer = await client.set_driving_enabled(False)
        assert (answer.accepted, answer.teleop.enabled) == (True, False)
        with pytest.raises(Refused) as ended:
            await eventually(lambda: _checked(session), bool, "the session has ended")
        assert ended.value.reason == Reason.TELEOP_DISABLED
    assert await is_at_rest(robot.base)
    with pytest.raises(Refused) as refused:
        async with client.drive(BY_EYE):
            pass
    assert refused.value.reason == Reason.TELEOP_DISABLED
    assert (await client.send_velocity(SPEED_MPS)).accepted is False
    assert (await client.set_driving_enabled(True)).accepted


@anew_after_a_loss
async def test_single_commands_of_older_tools_move_slowly_and_not_for_long(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    await may_be_driven(client)
    for refused in ((0.36, 0.0, 0.0), (0.0, -0.36, 0.0), (0.0, 0.0, 0.81), (float("nan"), 0.0, 0.0)):
        assert not (await client.send_velocity(*refused)).accepted
    robot.base.heard.clear()
    answer = await client.send_velocity(0.3)
    assert answer.accepted, answer.message
    await eventually(lambda: _moves(robot), bool, "it moves")
    await eventually(lambda: is_at_rest(robot.base), bool, "it has stopped by itself")
    moving = [each for each in robot.base.heard if each.moves]
    assert max(each.vx_mps for each in moving) <= 0.15 + 1e-6
    assert moving[-1].stamp_s - moving[0].stamp_s <= 0.5
    await client.send_velocity(0.0)
    assert (await teleop_of(client)).last_command.available


async def sent_on_a_channel_of_its_own(robot: DrivenRobot, method: str, request: bytes) -> bytes:
    """As the tools in the field do it: bytes by the locked numbers, a new connection for each call."""
    options = (("grpc.use_local_subchannel_pool", 1),)
    async with grpc.aio.insecure_channel(robot.target, options=options) as channel:
        call = raw_unary(channel, f"/omniseer.gateway.v1.RobotGateway/{method}")
        return await call(request, timeout=5)


@anew_after_a_loss
async def test_the_bytes_of_tools_in_the_field_drive_and_every_command_ends_by_itself(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    await may_be_driven(client)
    enabled = await sent_on_a_channel_of_its_own(robot, "SetTeleopEnabled", b"\x08\x01")
    assert enabled.startswith(b"\x08\x01"), "accepted = 1: true"
    forward = b"\x0d" + struct.pack("<f", 0.1) + b"\x1d" + struct.pack("<f", -0.2)

    async def stopped_after_s() -> float:
        robot.base.heard.clear()
        for _ in range(5):
            answer = await sent_on_a_channel_of_its_own(robot, "SendTeleopCommand", forward)
            sent_s = time.monotonic()
            assert answer.startswith(b"\x08\x01"), answer
            await asyncio.sleep(0.2)
        await eventually(lambda: is_at_rest(robot.base), bool, "it has stopped by itself")
        moving = [each for each in robot.base.heard if each.moves]
        turns_forward = {(each.vy_mps, each.vx_mps > 0, each.wz_rad_s < 0) for each in moving[5:]}
        assert turns_forward == {(0.0, True, True)}
        return robot.base.stopped_after_s(sent_s)

    await keeps_async(0.6, "s until a command has ended: 500 ms, and its way", stopped_after_s)
    beyond = b"\x0d" + struct.pack("<f", 0.4)
    refused = system_message(await sent_on_a_channel_of_its_own(robot, "SendTeleopCommand", beyond))
    assert (refused.accepted, "0.35" in refused.message) == (False, True)
    assert refused.teleop.last_error == refused.message
    await client.status()


def system_message(answer: bytes) -> Any:
    return robot_gateway_pb2.SendTeleopCommandResponse.FromString(answer)


async def _moves(robot: DrivenRobot) -> bool:
    return robot.base.moves


async def test_a_flood_closes_the_lane_and_a_second_opening_is_an_error(
    robot: DrivenRobot, client: AsyncGatewayClient
) -> None:
    await client.status()
    with pytest.raises(Overloaded) as flooded:
        await raw_lane(robot, [{"command": {"sequence": number}} for number in range(1, 500)])
    assert flooded.value.reason == Reason.TOO_MANY_REQUESTS
    wrong: list[dict[str, Any]] = [{"open": {}}, {"command": {"sequence": 1, "vx_mps": float("inf")}}, {}]
    for later in wrong:
        with pytest.raises(GatewayError) as refused:
            await raw_lane(robot, [later])
        assert refused.value.reason == Reason.INVALID_REQUEST


async def raw_lane(robot: DrivenRobot, requests: list[dict[str, Any]]) -> None:
    """Opens a lane, sends requests, and raises what the lane ends with."""
    await asyncio.to_thread(blocking_lane, robot.target, requests)


def blocking_lane(target: str, requests: list[dict[str, Any]]) -> None:
    """In a thread: asyncio's client makes up a status where a call ends while a request is written."""
    opened = threading.Event()

    def sent() -> Iterator[Any]:
        opening = teleop_pb2.DriveOpen(supervision=teleop_pb2.SUPERVISION_LINE_OF_SIGHT)
        yield teleop_pb2.DriveRequest(open=opening)
        opened.wait(10)
        for request in requests:
            yield teleop_pb2.DriveRequest(**request)

    with grpc.insecure_channel(target, options=(("grpc.use_local_subchannel_pool", 1),)) as channel:
        try:
            for _ in TeleopServiceStub(channel).Drive(sent(), timeout=20):
                opened.set()
        except grpc.RpcError as failure:
            raise error_from(failure, target, 0.0) from None


async def newest_events(client: AsyncGatewayClient) -> list[Any]:
    found = []
    async for item in client.events():
        if isinstance(item, CaughtUp):
            break
        if isinstance(item, Event):
            found.append(item)
    return found
