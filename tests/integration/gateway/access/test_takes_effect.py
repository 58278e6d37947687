"""Changes of credentials take effect without a restart, for open streams as well."""

import asyncio
import json
import ssl
import threading
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, NoReturn

import grpc
import pytest
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub

from common.errors import DomainError
from common.reasons import Reason
from common.refusal import refusal_in
from gateway.access import reloader
from gateway.access.credential import Kind
from gateway.access.repeats import BURST
from gateway.access.role import Role
from gateway.access.token import new_token
from gateway.rpc.connections.refusal_delay import RefusalDelay
from gateway.rpc.mapping.enums import SEVERITIES
from gateway.rpc.server import SERVICE
from omniseer.gateway.v1.robot_gateway_pb2 import (
    GetSystemStatusRequest,
    PingRequest,
    SetPreviewModeRequest,
    SubscribeEventsRequest,
    WatchSystemStatusRequest,
)
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.eventually import eventually
from tests.support.guarded_gateway import NOTHING, Login, Robot, guarded_gateway, new_robot
from tests.support.promise import keeps_async

FLOOD, AT_ONCE = 50, 10
MANY = 100
"""Streams of one credential."""
REVOKED_WITHIN_S = 10.0
"""The promise of a second is measured below, where few other tests run."""


def stub(robot: Robot, login: Login = NOTHING) -> Any:
    return RobotGatewayStub(robot.channel(login))


async def ping(robot: Any, login: Login) -> str:
    """The reason for which it was refused; empty when it was not."""
    try:
        await robot.Ping(PingRequest(), metadata=login.metadata(), timeout=5)
    except grpc.aio.AioRpcError as error:
        return refusal_in(error.trailing_metadata()).reason or error.code().name
    return ""


async def to_its_end(stream: Any) -> None:
    while await stream.read() is not grpc.aio.EOF:
        pass


async def until(look: Callable[[], Awaitable[Any]], wanted: Any) -> None:
    await eventually(look, lambda seen: seen == wanted, f"{wanted!r}")


async def test_a_new_token_counts_soon_and_a_revoked_one_no_more(tmp_path: Path) -> None:
    async with guarded_gateway(new_robot(tmp_path)) as robot:
        calls = stub(robot)
        credential, login = robot.add(Role.VIEWER)
        await until(lambda: ping(calls, login), "")
        robot.admin.revoke(credential.credential_id)
        await until(lambda: ping(calls, login), Reason.CREDENTIAL_REVOKED)


async def test_a_new_token_counts_at_its_first_use(tmp_path: Path) -> None:
    """`robot-gateway credentials add ... | robotctl login ...` asks within milliseconds."""
    async with guarded_gateway(new_robot(tmp_path)) as robot:
        for number in range(10):
            _, login = robot.add(Role.VIEWER, name=f"person-{number}")
            assert await ping(stub(robot), login) == ""


async def test_a_flood_of_unknown_tokens_shares_its_looks(tmp_path: Path) -> None:
    """Strangers cause ten reads of the files a second at the most, however many they are."""
    async with guarded_gateway(new_robot(tmp_path)) as robot:
        strangers = [Login(new_token(f"{number:012x}").text()) for number in range(80)]
        calls = stub(robot)
        began_s = time.monotonic()
        said = await asyncio.gather(*(ping(calls, each) for each in strangers))
        # One look is shared by all that wait for it; eighty looks in a row would take 8 s.
        assert time.monotonic() - began_s < 5
        assert set(said) <= {Reason.CREDENTIAL_UNKNOWN, Reason.LOCKED_OUT}
        _, login = robot.add(Role.VIEWER)
        assert await ping(calls, login) == ""


async def test_a_rotated_token_goes_over_without_a_gap(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, old = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):
        calls = stub(robot)
        _, bundle = robot.admin.rotate("anna", overlap_s=3600)
        new = Login(bundle.token)
        await until(lambda: ping(calls, new), "")
        assert await ping(calls, old) == ""


@pytest.mark.parametrize("how", ["revoked", "expires"])
@pytest.mark.parametrize("method", ["WatchSystemStatus", "SubscribeEvents"])
async def test_open_streams_end_with_the_credential_and_no_others_do(
    tmp_path: Path, how: str, method: str
) -> None:
    robot = new_robot(tmp_path)
    # Late enough that both streams are open by then.
    days = (time.time() % 1 + 6) / 86_400 if how == "expires" else None
    credential, login = robot.add(Role.VIEWER, days=days)
    _, other = robot.add(Role.VIEWER, name="ben")
    request = {"WatchSystemStatus": WatchSystemStatusRequest(), "SubscribeEvents": SubscribeEventsRequest()}
    async with guarded_gateway(robot):
        ending = getattr(stub(robot), method)(request[method], metadata=login.metadata())
        staying = getattr(stub(robot), method)(request[method], metadata=other.metadata())
        await ending.read()
        await staying.read()
        if how == "revoked":
            robot.admin.revoke(credential.credential_id)
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await asyncio.wait_for(to_its_end(ending), 20)
        assert caught.value.code() is grpc.StatusCode.UNAUTHENTICATED
        assert refusal_in(caught.value.trailing_metadata()).reason == Reason.CREDENTIAL_REVOKED
        async with asyncio.timeout(10):
            assert await staying.read() is not grpc.aio.EOF
        staying.cancel()


async def test_every_one_of_many_streams_learns_why_it_ended(tmp_path: Path) -> None:
    """Statuses go on being sent while they are ended one after the other."""
    robot = new_robot(tmp_path)
    credential, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):
        request = WatchSystemStatusRequest(min_interval_ms=50)
        streams = [
            calls.WatchSystemStatus(request, metadata=login.metadata())
            for calls in (stub(robot) for _ in range(MANY // 5))
            for _ in range(5)
        ]
        for each in streams:
            await each.read()
        robot.admin.revoke(credential.credential_id)
        async with asyncio.timeout(REVOKED_WITHIN_S):
            ends = await asyncio.gather(*map(to_its_end, streams), return_exceptions=True)
        reasons = {
            refusal_in(end.trailing_metadata()).reason if isinstance(end, grpc.aio.AioRpcError) else repr(end)
            for end in ends
        }
        assert reasons == {Reason.CREDENTIAL_REVOKED}


async def test_a_stream_that_is_not_read_ends_on_the_robots_side(tmp_path: Path) -> None:
    """Its caller learns nothing, but it costs the robot nothing any more."""
    robot = new_robot(tmp_path)
    credential, login = robot.add(Role.VIEWER)
    _, admin = robot.add(Role.ADMIN, name="ben")
    async with guarded_gateway(robot):
        unread = stub(robot).WatchSystemStatus(
            WatchSystemStatusRequest(min_interval_ms=50), metadata=login.metadata()
        )
        calls = stub(robot)

        async def reported(detail: str) -> bool:
            events = calls.SubscribeEvents(SubscribeEventsRequest(), metadata=admin.metadata(), timeout=5)
            found = False
            async for answer in events:
                if answer.HasField("caught_up"):
                    break
                found = found or answer.event.HasField(detail)
            events.cancel()
            return found

        await until(lambda: reported("client_joined"), True)
        robot.admin.revoke(credential.credential_id)
        await until(lambda: reported("client_left"), True)
        unread.cancel()


@pytest.mark.timed
@pytest.mark.alone
async def test_a_change_of_the_credentials_is_in_force_within_a_second(tmp_path: Path) -> None:
    async with guarded_gateway(new_robot(tmp_path)) as robot:
        calls = stub(robot)

        async def slowest_s() -> float:
            return max([await added_and_revoked_s(robot, calls) for _ in range(5)])

        await keeps_async(1.0, "s until a change is in force", slowest_s)


async def added_and_revoked_s(robot: Robot, calls: Any) -> float:
    """The longer of both."""
    credential, login = robot.add(Role.VIEWER)
    began_s = time.monotonic()
    await until(lambda: ping(calls, login), "")
    added_s = time.monotonic() - began_s
    robot.admin.revoke(credential.credential_id)
    began_s = time.monotonic()
    await until(lambda: ping(calls, login), Reason.CREDENTIAL_REVOKED)
    return max(added_s, time.monotonic() - began_s)


@pytest.mark.timed
async def test_a_hundred_revoked_streams_end_within_a_second(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)

    async def took_s() -> float:
        credential, login = robot.add(Role.VIEWER)
        calls = stub(running)
        # Until its credential is in force the connection has no place, and a few streams only.
        await until(lambda: ping(calls, login), "")
        streams = [
            calls.SubscribeEvents(SubscribeEventsRequest(), metadata=login.metadata()) for _ in range(100)
        ]
        for stream in streams:
            await stream.read()
        began_s = time.monotonic()
        robot.admin.revoke(credential.credential_id)
        ends = await asyncio.gather(*map(to_its_end, streams), return_exceptions=True)
        elapsed_s = time.monotonic() - began_s
        assert {each.code() for each in ends if isinstance(each, grpc.aio.AioRpcError)} == {
            grpc.StatusCode.UNAUTHENTICATED
        }
        return elapsed_s

    async with guarded_gateway(robot, limits={"streams_per_connection": 100}) as running:
        await keeps_async(1.0, "s until a hundred revoked streams have ended", took_s)


async def test_callers_that_leave_while_they_are_refused_harm_no_other(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    credential, login = robot.add(Role.VIEWER)
    _, other = robot.add(Role.VIEWER, name="ben")
    async with guarded_gateway(robot, limits={"streams_per_connection": 64}):
        calls = stub(robot, login)
        streams = [
            calls.WatchSystemStatus(WatchSystemStatusRequest(min_interval_ms=50), metadata=login.metadata())
            for _ in range(40)
        ]
        for stream in streams:
            await stream.read()
        robot.admin.revoke(credential.credential_id)
        # Some leave before they are sent away, some at the same moment, some after.
        for stream in streams:
            stream.cancel()
            await asyncio.sleep(0.03)
        assert await ping(stub(robot), other) == ""
        await until(lambda: ping(stub(robot), login), Reason.CREDENTIAL_REVOKED)


async def test_a_new_server_certificate_is_shown_and_no_connection_is_cut_off(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):
        before = stub(robot)
        stream = before.WatchSystemStatus(WatchSystemStatusRequest(), metadata=login.metadata())
        await stream.read()
        old = await shown_certificate(robot.port)
        robot.admin.rotate_server(None)

        async def changed() -> bool:
            return await shown_certificate(robot.port) != old

        await until(changed, True)
        assert await ping(stub(robot), login) == ""
        assert await ping(before, login) == ""
        assert await stream.read() is not grpc.aio.EOF
        stream.cancel()
    (record,) = records_of(robot.audit_file)
    assert record["answer"] == "certificates were exchanged; 1 credentials are listed"


async def test_a_new_ca_ends_what_the_old_one_has_signed_and_leaves_tokens(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, token = robot.add(Role.VIEWER)
    robot.add(Role.VIEWER, Kind.CERTIFICATE, name="ben")
    async with guarded_gateway(robot):
        old_ca = robot.ca
        over = robot.admin.rotate_ca(None)
        assert [each.name for each in over] == ["ben"]

        async def with_new_ca() -> str:
            return await ping(stub(robot), token)

        await until(with_new_ca, "")
        assert await ping(RobotGatewayStub(robot.channel(token, ca=old_ca)), token) == "UNAVAILABLE"
    answers = ", ".join(each["answer"] for each in records_of(robot.audit_file))
    assert "revoked ben" in answers
    assert "certificates were exchanged" in answers


async def test_a_damaged_list_changes_nothing_and_is_a_fault(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):
        calls = stub(robot)
        text = robot.directory.store_file.read_text()
        robot.directory.store_file.write_text(text[:-20])
        await until(lambda: faults(calls, login), {"access.credentials": "error"})
        assert await ping(calls, login) == ""
        robot.directory.store_file.write_text(text)
        await until(lambda: faults(calls, login), {})


async def test_a_list_that_stays_unreadable_admits_none_until_it_is_readable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.access.reloader.CLOSED_AFTER_S", 1.0)
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    async with guarded_gateway(robot):
        calls = stub(robot)
        health: Any = HealthStub(robot.channel())  # its type has no methods

        async def serving() -> bool:
            answer = await health.Check(HealthCheckRequest(service=SERVICE), timeout=5)
            return bool(answer.status == HealthCheckResponse.SERVING)

        stream = calls.WatchSystemStatus(WatchSystemStatusRequest(), metadata=login.metadata())
        await stream.read()
        hidden = robot.directory.store_file.rename(tmp_path / "elsewhere")
        assert await ping(calls, login) == ""
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await asyncio.wait_for(to_its_end(stream), 10)
        assert refusal_in(caught.value.trailing_metadata()).reason == Reason.CREDENTIALS_UNREADABLE
        assert await ping(calls, login) == Reason.CREDENTIALS_UNREADABLE
        await until(serving, False)
        hidden.rename(robot.directory.store_file)
        await until(lambda: ping(calls, login), "")
        await until(serving, True)
    shut, opened = [each["answer"] for each in records_of(robot.audit_file)]
    assert shut.startswith("no credential is accepted: ")
    assert opened == "credentials are accepted again; 1 credentials are listed"


async def test_a_disk_that_hangs_admits_none_until_it_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reads do not fail there, they do not end."""
    monkeypatch.setattr("gateway.access.reloader.CLOSED_AFTER_S", 1.0)
    monkeypatch.setattr("gateway.access.reloader.UNKNOWN_WITHIN_S", 0.2)
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    answers = threading.Event()
    answers.set()
    signature = reloader._signature

    def slow_signature(path: Path) -> tuple[int, ...]:
        answers.wait(30)
        return signature(path)

    monkeypatch.setattr("gateway.access.reloader._signature", slow_signature)
    async with guarded_gateway(robot):
        calls = stub(robot)
        stream = calls.WatchSystemStatus(WatchSystemStatusRequest(), metadata=login.metadata())
        await stream.read()
        answers.clear()
        try:
            assert await ping(calls, login) == ""
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await asyncio.wait_for(to_its_end(stream), 10)
            assert refusal_in(caught.value.trailing_metadata()).reason == Reason.CREDENTIALS_UNREADABLE
            assert await ping(calls, login) == Reason.CREDENTIALS_UNREADABLE
            assert await ping(calls, Login(new_token("0" * 12).text())) == Reason.CREDENTIAL_UNKNOWN, (
                "it is not kept waiting"
            )
        finally:
            answers.set()
        await until(lambda: ping(calls, login), "")


async def test_certificates_near_their_end_are_faults(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.VIEWER)
    # Longer than the server's certificate lasts, shorter than the CA does.
    _, client = robot.add(Role.VIEWER, Kind.CERTIFICATE)
    async with guarded_gateway(robot, faults={"expiry_days": 900}):
        calls = stub(robot)
        await until(lambda: faults(calls, login), {"access.server_certificate": "warning"})
    async with guarded_gateway(
        robot, faults={"expiry_days": 3650}, security={"tls": {"client_certificates": True}}
    ):
        shown = stub(robot, client)
        await until(
            lambda: faults(shown, NOTHING),
            {"access.server_certificate": "warning", "access.authority": "warning"},
        )


def records_of(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text().splitlines()]


async def test_every_control_action_is_recorded_of_any_caller(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    operator, login = robot.add(Role.OPERATOR)
    viewer, viewer_login = robot.add(Role.VIEWER, name="ben")
    async with guarded_gateway(robot):
        calls = stub(robot)
        switch = calls.SetPreviewMode
        await switch(SetPreviewModeRequest(enabled=True), metadata=login.metadata(), timeout=5)
        for refused in (viewer_login, NOTHING):
            with pytest.raises(grpc.aio.AioRpcError):
                await switch(SetPreviewModeRequest(enabled=True), metadata=refused.metadata(), timeout=5)
        with pytest.raises(grpc.aio.AioRpcError):
            await switch(
                SetPreviewModeRequest(enabled=True, profile=99),  # type: ignore[arg-type]  # what no client sends
                metadata=login.metadata(),
                timeout=5,
            )
        status = await calls.GetSystemStatus(GetSystemStatusRequest(), metadata=login.metadata(), timeout=5)
        assert (status.gateway.requests_served, status.gateway.requests_refused) == (1, 3)
    records = records_of(robot.audit_file), records_of(robot.refused_file)
    assert [[(each["who"], each["role"], each["credential"]) for each in file] for file in records] == [
        [("anna", "operator", operator.credential_id)],
        [
            ("ben", "viewer", viewer.credential_id),
            ("", "", ""),
            ("anna", "operator", operator.credential_id),
        ],
    ]
    assert [{each["result"] for each in file} for file in records] == [{"accepted"}, {"refused"}]
    for each in (*records[0], *records[1]):
        assert each["action"] == "SetPreviewMode"
        assert each["address"].startswith("127.0.0.1:")
        assert each["time"].endswith("+00:00")
    for file in (robot.audit_file, robot.refused_file):
        assert file.stat().st_mode & 0o777 == 0o600


async def test_a_stranger_that_hangs_up_before_its_refusal_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused, refuse = asyncio.Event(), RefusalDelay.refuse

    async def noticed(self: RefusalDelay, error: DomainError, waited_s: float = 0.0) -> NoReturn:
        refused.set()
        await refuse(self, error, waited_s)

    monkeypatch.setattr(RefusalDelay, "refuse", noticed)
    # Longer than this test lasts: no refusal leaves before its caller does.
    monkeypatch.setattr("gateway.rpc.connections.refusal_delay.REFUSAL_DELAY_S", 60.0)
    robot = new_robot(tmp_path)
    async with guarded_gateway(robot):
        call = stub(robot).SetPreviewMode(SetPreviewModeRequest(enabled=True), metadata=NOTHING.metadata())
        await asyncio.wait_for(refused.wait(), 10)
        call.cancel()
        with pytest.raises(asyncio.CancelledError):
            await call
    [record] = records_of(robot.refused_file)
    assert (record["who"], record["action"], record["result"]) == ("", "SetPreviewMode", "refused")


async def test_operators_see_who_was_refused_and_a_flood_by_its_number(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, login = robot.add(Role.OPERATOR)
    _, viewer_login = robot.add(Role.VIEWER, name="ben")
    async with guarded_gateway(robot):
        calls = stub(robot)
        events = calls.SubscribeEvents(SubscribeEventsRequest(), metadata=login.metadata())

        async def refused(shown: Login) -> None:
            with pytest.raises(grpc.aio.AioRpcError):
                await calls.SetPreviewMode(
                    SetPreviewModeRequest(enabled=True), metadata=shown.metadata(), timeout=5
                )

        await refused(viewer_login)
        for _ in range(FLOOD // AT_ONCE):
            await asyncio.gather(*(refused(NOTHING) for _ in range(AT_ONCE)))
        await refused(viewer_login)
        expected = ["ben", *["a stranger"] * BURST, "ben"]

        seen: list[str] = []
        async with asyncio.timeout(20):
            while len(seen) < len(expected):
                answer = await events.read()
                if answer.event.HasField("control_action"):
                    seen.append(answer.event.control_action.who or "a stranger")
        assert seen == expected
        events.cancel()
    records = records_of(robot.refused_file)
    assert [each["who"] or "a stranger" for each in records] == [*expected, "a stranger"]
    assert [each.get("count", 1) for each in records] == [1] * len(expected) + [FLOOD - BURST]
    assert not robot.audit_file.exists()


async def test_who_guesses_waits_and_others_at_the_same_address_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A wait that is not over before the right ones have been answered.
    monkeypatch.setattr("gateway.access.lockout.FIRST_WAIT_S", 10.0)
    robot = new_robot(tmp_path)
    _, annas = robot.add(Role.VIEWER)
    _, bens = robot.add(Role.VIEWER, name="ben")
    assert annas.token
    wrong = Login(annas.token[:-1] + ("A" if annas.token[-1] != "A" else "B"))
    async with guarded_gateway(robot):
        calls = stub(robot)
        assert [await ping(calls, wrong) for _ in range(6)] == [Reason.CREDENTIAL_UNKNOWN] * 6
        # Locked are guesses at that token, from here. The right one is none, and does not help the guesser.
        for right in (annas, bens):
            assert await ping(calls, right) == ""
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await calls.Ping(PingRequest(), metadata=wrong.metadata(), timeout=5)
        assert caught.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        refusal = refusal_in(caught.value.trailing_metadata())
        assert refusal.reason == Reason.LOCKED_OUT
        assert refusal.retry_after_s is not None
        assert 0 < refusal.retry_after_s <= 10


async def shown_certificate(port: int) -> str:
    """What a stranger is shown."""
    return await asyncio.to_thread(ssl.get_server_certificate, ("127.0.0.1", port), timeout=5)


async def faults(calls: Any, login: Login) -> dict[str, str]:
    """Active faults of the door, and how bad they are."""
    answer = await calls.GetSystemStatus(GetSystemStatusRequest(), metadata=login.metadata(), timeout=5)
    words = {number: severity.value for severity, number in SEVERITIES.items()}
    return {
        each.id: words[each.severity]
        for each in answer.faults
        if each.active and each.id.startswith("access.")
    }
