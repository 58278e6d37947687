"""Every method, every role, every kind of credential, over real sockets with real TLS, by the schema."""

import asyncio
import time
from pathlib import Path
from typing import Any

import grpc
import pytest
from grpc_health.v1 import health_pb2
from grpc_reflection.v1alpha import reflection_pb2

from common.healthcheck import state_of
from common.reasons import Reason
from gateway.access.credential import Kind
from gateway.access.role import Role
from gateway.rpc.calls.methods import ROLES
from omniseer.gateway.v1 import recording_pb2, robot_gateway_pb2, teleop_pb2
from omniseer.gateway.v1.access_pb2 import required_role
from tests.support.guarded_gateway import NOTHING, Login, Robot, guarded_gateway, new_robot, refuse_at_once
from tests.support.refusals import reason_of
from tests.support.running_gateway import raw_unary

SERVICE = robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"]
TELEOP = teleop_pb2.DESCRIPTOR.services_by_name["TeleopService"]
RECORDING = recording_pb2.DESCRIPTOR.services_by_name["RecordingService"]
METHODS = [*SERVICE.methods, *TELEOP.methods, *RECORDING.methods]
DRIVE = f"/{TELEOP.full_name}/Drive"
REFLECTION = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"
OK, UNAUTHENTICATED = grpc.StatusCode.OK, grpc.StatusCode.UNAUTHENTICATED
DENIED, UNAVAILABLE = grpc.StatusCode.PERMISSION_DENIED, grpc.StatusCode.UNAVAILABLE
PATHS = {
    f"/{method.containing_service.full_name}/{method.name}": (
        ROLES[method.GetOptions().Extensions[required_role]],
        method.server_streaming,
    )
    for method in METHODS
} | {REFLECTION: (Role.VIEWER, True)}
"""Every method that needs a role: which, and whether it streams."""
ANSWERS = dict.fromkeys(PATHS, (OK, "")) | {
    # There is no preview.
    f"/{SERVICE.full_name}/RequestKeyFrame": (
        grpc.StatusCode.FAILED_PRECONDITION,
        Reason.PREVIEW_NOT_RUNNING,
    )
}
# Nor a drive program.
ANSWERS |= {
    path: (grpc.StatusCode.FAILED_PRECONDITION, Reason.TELEOP_NOT_CONFIGURED)
    for path in PATHS
    if path.startswith(f"/{TELEOP.full_name}/") or "Teleop" in path.rpartition("/")[2]
}
# Nor a recorder; most requests need an ID, and are refused without one before that.
ANSWERS |= {
    f"/{RECORDING.full_name}/{method.name}": (grpc.StatusCode.INVALID_ARGUMENT, Reason.INVALID_REQUEST)
    for method in RECORDING.methods
} | {
    f"/{RECORDING.full_name}/ListRecordings": (
        grpc.StatusCode.FAILED_PRECONDITION,
        Reason.RECORDING_NOT_CONFIGURED,
    )
}
"""What an empty request leads to, where the role suffices."""


@pytest.fixture(autouse=True)
def no_refusal_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_at_once(monkeypatch)


async def called(channel: grpc.aio.Channel, path: str, login: Login) -> tuple[grpc.StatusCode, str]:
    """The code and the reason that the method ends with, or with which its first answer comes."""
    metadata = login.metadata()
    try:
        if path in (REFLECTION, DRIVE):
            both_ways: Any = channel.stream_stream(path)(metadata=metadata, timeout=10)
            request = reflection_pb2.ServerReflectionRequest(list_services="").SerializeToString()
            await both_ways.write(request if path == REFLECTION else b"")
            await both_ways.read()
            both_ways.cancel()
        elif PATHS[path][1]:
            method: grpc.aio.UnaryStreamMultiCallable[bytes, bytes] = channel.unary_stream(path)
            stream: Any = method(b"", metadata=metadata, timeout=10)
            await stream.read()
            stream.cancel()
        else:
            await raw_unary(channel, path)(b"", metadata=metadata, timeout=10)
    except grpc.aio.AioRpcError as error:
        return reason_of(error)
    return OK, ""


async def answered(channel: grpc.aio.Channel, path: str, login: Login) -> tuple[grpc.StatusCode, str]:
    """As `called`. Again where the server ended a call while its request was written.

    gRPC's asyncio client then makes up a status of its own, INTERNAL, and the server's is lost.
    """
    for _ in range(5):
        if (answer := await called(channel, path, login)) != (grpc.StatusCode.INTERNAL, ""):
            break
    return answer


async def all_called(robot: Robot, login: Login) -> dict[str, tuple[grpc.StatusCode, str]]:
    channel = robot.channel(login)
    return {path: await answered(channel, path, login) for path in PATHS}


def expected_for(role: Role) -> dict[str, tuple[grpc.StatusCode, str]]:
    return {
        path: ANSWERS[path] if role.may(needed) else (DENIED, Reason.ROLE_TOO_LOW)
        for path, (needed, _) in PATHS.items()
    }


def all_refused(code: grpc.StatusCode, reason: str) -> dict[str, tuple[grpc.StatusCode, str]]:
    return dict.fromkeys(PATHS, (code, reason))


def test_there_is_something_to_refuse() -> None:
    assert {needed for needed, _ in PATHS.values()} >= {Role.VIEWER, Role.OPERATOR}
    assert len(PATHS) == len(METHODS) + 1


async def test_each_token_gives_its_role_and_nothing_else_gives_any(tmp_path: Path) -> None:
    robot, other = new_robot(tmp_path / "a"), new_robot(tmp_path / "b")
    tomorrow = int(time.time()) + 86_400
    tokens = {role: robot.add(role) for role in Role}
    over = robot.add(Role.ADMIN, days=1e-9)[1]
    early = robot.add(Role.ADMIN, begins_s=tomorrow)[1]
    revoked, revoked_login = robot.add(Role.ADMIN)
    robot.admin.revoke(revoked.credential_id)
    foreign = other.add(Role.ADMIN)[1]
    right = tokens[Role.ADMIN][1].token or ""
    wrong = Login(right[:-1] + ("A" if right[-1] != "A" else "B"))
    # Few of them, because there are more methods than wrong guesses that are free.
    async with guarded_gateway(robot) as robot:
        for role, (_, login) in tokens.items():
            assert await all_called(robot, login) == expected_for(role)
        assert await all_called(robot, NOTHING) == all_refused(UNAUTHENTICATED, Reason.CREDENTIAL_MISSING)
        assert await all_called(robot, over) == all_refused(UNAUTHENTICATED, Reason.CREDENTIAL_EXPIRED)
        assert await all_called(robot, early) == all_refused(UNAUTHENTICATED, Reason.CREDENTIAL_NOT_YET_VALID)
        assert await all_called(robot, revoked_login) == all_refused(
            UNAUTHENTICATED, Reason.CREDENTIAL_REVOKED
        )
    for login in (wrong, foreign, Login(""), Login("x" * 5000), Login("rgt-000000000000." + "A" * 43)):
        for path in PATHS:
            # A fresh gateway every few calls has no lockouts yet.
            async with guarded_gateway(robot) as robot:
                assert await answered(robot.channel(), path, login) == (
                    UNAUTHENTICATED,
                    Reason.CREDENTIAL_UNKNOWN,
                )


async def test_each_certificate_gives_its_role_and_nothing_else_gives_any(tmp_path: Path) -> None:
    robot, other = new_robot(tmp_path / "a"), new_robot(tmp_path / "b")
    tomorrow = int(time.time()) + 86_400
    certificates = {role: robot.add(role, Kind.CERTIFICATE) for role in Role}
    over = robot.add(Role.ADMIN, Kind.CERTIFICATE, days=1e-9)[1]
    early = robot.add(Role.ADMIN, Kind.CERTIFICATE, begins_s=tomorrow, days=2)[1]
    revoked, revoked_login = robot.add(Role.ADMIN, Kind.CERTIFICATE)
    robot.admin.revoke(revoked.credential_id)
    foreign = other.add(Role.ADMIN, Kind.CERTIFICATE)[1]
    token = robot.add(Role.ADMIN)[1]
    async with guarded_gateway(robot, security={"tls": {"client_certificates": True}}) as robot:
        for role, (_, login) in certificates.items():
            assert await all_called(robot, login) == expected_for(role)
        # TLS itself turns these away: they see no method at all.
        for login in (NOTHING, over, foreign, token):
            assert await all_called(robot, login) == all_refused(UNAVAILABLE, "")
        assert await all_called(robot, revoked_login) == all_refused(
            UNAUTHENTICATED, Reason.CREDENTIAL_REVOKED
        )
        assert await all_called(robot, early) == all_refused(UNAUTHENTICATED, Reason.CREDENTIAL_NOT_YET_VALID)


async def test_a_token_beside_a_certificate_never_gives_more_than_either(tmp_path: Path) -> None:
    robot = new_robot(tmp_path / "a")
    certificate = robot.add(Role.OPERATOR, Kind.CERTIFICATE)[1]
    viewer, admin = robot.add(Role.VIEWER)[1], robot.add(Role.ADMIN)[1]
    somebody_else = robot.add(Role.ADMIN, name="ben")[1]
    async with guarded_gateway(robot, security={"tls": {"client_certificates": True}}) as robot:
        assert await all_called(robot, Login(viewer.token, certificate.client)) == expected_for(Role.VIEWER)
        assert await all_called(robot, Login(admin.token, certificate.client)) == expected_for(Role.OPERATOR)
        assert await all_called(robot, Login(somebody_else.token, certificate.client)) == all_refused(
            UNAUTHENTICATED, Reason.CREDENTIAL_UNKNOWN
        )


async def test_health_needs_no_credential_and_all_else_does(tmp_path: Path) -> None:
    async with guarded_gateway(new_robot(tmp_path / "a")) as robot:
        check = raw_unary(robot.channel(), "/grpc.health.v1.Health/Check")
        answer = health_pb2.HealthCheckResponse.FromString(await check(b"", timeout=5))
        assert answer.status == health_pb2.HealthCheckResponse.SERVING
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await raw_unary(robot.channel(), f"/{SERVICE.full_name}/Nothing")(b"", timeout=5)
        assert caught.value.code() is grpc.StatusCode.UNIMPLEMENTED


async def test_the_local_socket_is_for_health_checks_and_asks_for_the_rest(tmp_path: Path) -> None:
    robot = new_robot(tmp_path / "a")
    login = robot.add(Role.VIEWER)[1]
    socket = tmp_path / "health.sock"
    ping = f"/{SERVICE.full_name}/Ping"
    async with (
        guarded_gateway(robot, grpc={"socket": socket}, security={"tls": {"client_certificates": True}}),
        grpc.aio.insecure_channel(f"unix:{socket}") as local,
    ):
        assert await asyncio.to_thread(state_of, f"unix:{socket}") == "SERVING"
        assert await called(local, ping, NOTHING) == (UNAUTHENTICATED, Reason.CREDENTIAL_MISSING)
        assert await called(local, ping, login) == (OK, "")


async def test_neither_plaintext_nor_another_robots_ca_gets_anywhere(tmp_path: Path) -> None:
    robot, other = new_robot(tmp_path / "a"), new_robot(tmp_path / "b")
    login = robot.add(Role.ADMIN)[1]
    ping = f"/{SERVICE.full_name}/Ping"
    async with guarded_gateway(robot) as robot:
        # The client finds out before it shows anything.
        assert (await called(robot.channel(login, ca=other.ca), ping, login))[0] is UNAVAILABLE
        async with grpc.aio.insecure_channel(f"127.0.0.1:{robot.port}") as plain:
            assert (await called(plain, ping, login))[0] is UNAVAILABLE
        assert (await called(robot.channel(), ping, login))[0] is OK
