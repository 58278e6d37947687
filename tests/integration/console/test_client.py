"""Both clients over real sockets: good gateways, gateways that say no, and links that fail.

The policy itself (pauses, deadlines, what is settled) is played by hand in the unit tests; here gRPC is below
it, and the clock is the wall's.
"""

import asyncio
import gc
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import psutil
import pytest

from common.errors import ExitCode
from console.client import (
    Backoff,
    Cancelled,
    ClientOptions,
    DeadlineExceeded,
    GatewayClient,
    GatewayError,
    GatewayFailed,
    Overloaded,
    PictureDelivery,
    PictureReport,
    PreviewProfile,
    PreviewState,
    Refused,
    Unreachable,
    Unsupported,
)
from console.client.error_table import ERRORS
from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.client.results import Freshness, HealthState
from omniseer.gateway.v1 import overlay_pb2, preview_pb2, robot_gateway_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.bad_links import Relay, black_hole
from tests.support.clients import FACES, Blocking, Face
from tests.support.free import free_tcp_port
from tests.support.gateway_double import (
    STREAM_URI,
    GatewayDouble,
    StreamingGatewayDouble,
    serving,
    serving_handlers,
)
from tests.support.patient import PATIENT
from tests.support.promise import keeps
from tests.support.undisturbed import no_stall, undisturbed
from tests.support.waiting import wait_until

UNAVAILABLE = (grpc.StatusCode.UNAVAILABLE, "the robot is starting")
CANCELLED = (grpc.StatusCode.CANCELLED, "too many calls")
HURRIED = ClientOptions(answer_within_s=0.3, preview_within_s=0.3)
# Much more than any promise below and much less than 20 s, for which the double holds a call.
AT_LAST_S = 8.0
SILENCE_NOTICED_WITHIN_S = 5.0

Ask = Callable[[Face], Any]
METHODS: dict[str, Ask] = {
    "status": lambda robot: robot.status(),
    "overlay": lambda robot: robot.overlay(),
    "info": lambda robot: robot.info(),
    "enable": lambda robot: robot.enable_preview(settle_within_s=0),
    "disable": lambda robot: robot.disable_preview(settle_within_s=0),
}


@pytest.fixture(params=FACES, ids=lambda face: face.__name__.lower())
def face(request: pytest.FixtureRequest) -> type[Face]:
    return request.param  # type: ignore[no-any-return]  # pytest's own type


@pytest.fixture(params=METHODS.values(), ids=list(METHODS))
def ask(request: pytest.FixtureRequest) -> Ask:
    return request.param  # type: ignore[no-any-return]  # pytest's own type


@pytest.fixture
def port(double: GatewayDouble) -> Iterator[int]:
    with serving(double) as port:
        yield port


@pytest.fixture
def robot(face: type[Face], port: int) -> Iterator[Face]:
    with face(at(port), PATIENT) as robot:
        yield robot


def at(port: int) -> str:
    return f"127.0.0.1:{port}"


@contextmanager
def taking(at_most_s: float) -> Iterator[None]:
    """The block takes no longer."""
    began_s = time.monotonic()
    yield
    took_s = time.monotonic() - began_s
    assert took_s < at_most_s, f"{took_s:.1f} s"


# --- answers ---


def test_the_status_comes_as_typed_values(robot: Face) -> None:
    status = robot.status()
    assert (status.gateway_name, status.gateway_version) == ("lab-1", "1.2.3")
    assert (status.health.state, status.health.ready) == (HealthState.OK, True)
    assert (status.odometry.vx_mps, status.odometry.age_ms) == (0.5, 12)
    assert status.vision.freshness is Freshness.FRESH
    assert status.platform.power.lipo_battery.charge_percent == 78
    assert status.platform.power.lipo_battery.voltage_v is None
    assert status.effective_command.freshness is Freshness.MISSING
    assert status.preview.state is PreviewState.DISABLED
    assert status.preview.endpoint is None


def test_the_overlay_comes_as_typed_values(robot: Face, double: GatewayDouble) -> None:
    double.overlay.detections.MergeFrom(
        overlay_pb2.DetectionOverlayStatus(
            available=True, age_ms=30, source_width_px=1280, source_height_px=720, detection_count=2
        )
    )
    double.overlay.detections.detections.add(class_id=3, class_name="mug", score=0.5, bbox_width_px=40)
    double.overlay.events.add(sequence=1, age_ms=900, message="vision telemetry stale")
    overlay = robot.overlay()
    assert overlay.status.health.summary == "robot healthy"
    assert (overlay.detections.source_width_px, overlay.detections.count) == (1280, 2)
    assert [(one.class_name, one.score, one.width_px) for one in overlay.detections.items] == [
        ("mug", 0.5, 40)
    ]
    assert [(event.sequence, event.message) for event in overlay.events] == [(1, "vision telemetry stale")]


def test_the_program_behind_it_comes_as_typed_values(robot: Face) -> None:
    info = robot.info()
    assert (info.gateway_name, info.gateway_version) == ("lab-1", "1.2.3")
    assert info.configuration_json == '{"name": "lab-1"}'


def test_enabling_waits_until_frames_leave(robot: Face, double: GatewayDouble) -> None:
    double.preview_becomes += [states.PREVIEW_STARTING, states.PREVIEW_STARTING, states.PREVIEW_RUNNING]
    change = robot.enable_preview(PreviewProfile.LOW_BW)
    assert change.accepted
    assert (change.preview.state, change.preview.profile) == (PreviewState.RUNNING, PreviewProfile.LOW_BW)
    assert change.preview.endpoint
    assert change.preview.endpoint.uri == STREAM_URI
    assert [(request.enabled, request.profile) for request in double.preview_requests] == [
        (True, preview_pb2.PREVIEW_PROFILE_LOW_BW)
    ]


def test_a_fault_is_an_answer_with_its_reason(robot: Face, double: GatewayDouble) -> None:
    double.preview_becomes += [states.PREVIEW_STARTING, states.PREVIEW_FAULTED]
    change = robot.enable_preview()
    assert change.accepted
    assert change.preview.state is PreviewState.FAULTED
    assert change.preview.last_error == double.fault


def test_a_start_that_takes_too_long_comes_back_as_it_is(robot: Face, double: GatewayDouble) -> None:
    double.preview_becomes += [states.PREVIEW_STARTING] * 1000
    with taking(AT_LAST_S):
        change = robot.enable_preview(settle_within_s=0.3)
    assert change.preview.state is PreviewState.STARTING


def test_disabling_ends_disabled(robot: Face, double: GatewayDouble) -> None:
    double.preview_becomes += [states.PREVIEW_RUNNING]
    robot.enable_preview(PreviewProfile.LOW_BW)
    change = robot.disable_preview()
    assert (change.preview.state, change.preview.profile) == (PreviewState.DISABLED, PreviewProfile.LOW_BW)


def test_a_refused_request_is_not_followed_up(robot: Face, double: GatewayDouble) -> None:
    double.accept = False
    change = robot.enable_preview()
    assert not change.accepted
    assert change.message == "the robot is being serviced"
    assert double.calls == ["SetPreviewMode"]


def test_many_calls_at_once_share_a_connection(face: type[Face], port: int) -> None:
    with Relay(port) as relay, face(at(relay.port)) as robot:
        assert {status.gateway_name for status in robot.many_at_once(16)} == {"lab-1"}
        assert relay.connections == 1


# --- retries ---


def test_a_robot_that_is_not_ready_is_asked_again(
    face: type[Face], port: int, double: GatewayDouble, ask: Ask
) -> None:
    double.failures += [UNAVAILABLE, UNAVAILABLE]
    patient = replace(PATIENT, backoff=Backoff(first_s=0.01, give_up_after_s=30))
    with face(at(port), patient) as robot:
        ask(robot)
        assert len(double.calls) == 3
        assert len(set(double.calls)) == 1
        assert robot.retries == 2


def test_a_call_that_the_gateway_cancelled_is_made_again(
    face: type[Face], port: int, double: GatewayDouble, ask: Ask
) -> None:
    double.failures += [CANCELLED, UNAVAILABLE]
    patient = replace(PATIENT, backoff=Backoff(first_s=0.01, give_up_after_s=30))
    with face(at(port), patient) as robot:
        ask(robot)
        assert len(double.calls) == 3
        assert robot.retries == 2


def test_the_pauses_between_attempts_grow(face: type[Face], port: int, double: GatewayDouble) -> None:
    patient = replace(PATIENT, backoff=Backoff(give_up_after_s=30))
    double.failures += [UNAVAILABLE] * 4
    began_s = time.monotonic()
    with face(at(port), patient) as robot:
        robot.status()
        assert robot.retries == 4
    assert time.monotonic() - began_s >= 0.1 + 0.2 + 0.4 + 0.4


def test_attempts_end(robot: Face, double: GatewayDouble, ask: Ask) -> None:
    double.failures += [UNAVAILABLE] * 100

    def attempt() -> None:
        double.calls.clear()
        with no_stall():
            with taking(AT_LAST_S), pytest.raises(Unreachable, match="the robot is starting"):
                ask(robot)
            # On a busy machine fewer fit into the second; one alone after a stall for as long as that.
            assert 2 <= len(double.calls) <= 4

    undisturbed(attempt)


def test_what_must_not_happen_twice_is_asked_once(
    robot: Face, double: GatewayDouble, monkeypatch: pytest.MonkeyPatch
) -> None:
    once = replace(GET_SYSTEM_STATUS, idempotent=False)
    monkeypatch.setattr("console.client.aio.GET_SYSTEM_STATUS", once)
    double.failures.append(UNAVAILABLE)
    with pytest.raises(Unreachable):
        robot.status()
    assert double.calls == ["GetSystemStatus"]
    assert robot.retries == 0


# --- a gateway that says no ---


@pytest.mark.parametrize(
    "code",
    [code for code in grpc.StatusCode if ERRORS[code] is not Unreachable and code is not grpc.StatusCode.OK],
    ids=lambda code: code.name,
)
def test_every_other_failure_is_final_and_has_a_remedy(
    robot: Face, double: GatewayDouble, code: grpc.StatusCode
) -> None:
    double.failures.append((code, "because of that"))
    with pytest.raises(GatewayError) as seen:
        robot.status()
    assert type(seen.value) is ERRORS[code]
    assert robot.target in seen.value.what
    assert seen.value.remedy
    assert "\n" not in str(seen.value)
    assert len(double.calls) == 1
    assert robot.status().gateway_name == "lab-1", "the client goes on"


def test_a_refusal_has_the_robots_message(robot: Face, double: GatewayDouble) -> None:
    double.failures.append((grpc.StatusCode.RESOURCE_EXHAUSTED, "64 clients are enough"))
    with pytest.raises(Refused, match="refused: 64 clients are enough") as seen:
        robot.status()
    assert type(seen.value) is Overloaded
    assert seen.value.exit_code is ExitCode.FAILED


# --- deadlines ---


def test_no_call_waits_for_ever(face: type[Face], port: int, double: GatewayDouble, ask: Ask) -> None:
    double.hold.clear()
    with face(at(port), HURRIED) as robot, taking(AT_LAST_S):
        with pytest.raises(DeadlineExceeded, match=r"did not answer within 0\.3 s") as seen:
            ask(robot)
        assert seen.value.remedy
        assert seen.value.exit_code is ExitCode.UNREACHABLE
        assert robot.retries == 0, "whether it happened is not known: that is for the caller to judge"


def test_a_gateway_that_falls_silent_after_the_request_ends_the_wait(face: type[Face]) -> None:
    class FallsSilent(GatewayDouble):
        def SetPreviewMode(self, request: Any, context: Any) -> Any:  # noqa: N802 - the contract's name
            answer = super().SetPreviewMode(request, context)
            self.hold.clear()
            return answer

    double = FallsSilent()
    double.preview_becomes.append(states.PREVIEW_STARTING)
    # The preview call itself has time: it is the look at the status that is to be given up.
    with serving(double) as port, face(at(port), ClientOptions(answer_within_s=0.3)) as robot:
        with taking(AT_LAST_S), pytest.raises(DeadlineExceeded):
            robot.enable_preview(settle_within_s=60)
        assert double.calls == ["SetPreviewMode", "GetSystemStatus"]


def test_a_client_that_is_closed_meanwhile_says_so(robot: Face, double: GatewayDouble) -> None:
    double.hold.clear()
    with taking(AT_LAST_S), pytest.raises(Cancelled) as seen:
        robot.closed_while(lambda: double.calls)
    assert seen.value.remedy
    with pytest.raises(Cancelled):
        robot.status()


# --- links that fail ---


@contextmanager
def nothing() -> Iterator[str]:
    yield at(free_tcp_port())


@contextmanager
def a_hole() -> Iterator[str]:
    with black_hole() as port:
        yield at(port)


@contextmanager
def no_such_name() -> Iterator[str]:
    yield "no-such-robot.invalid:50051"


@contextmanager
def a_listener_that_says_nothing() -> Iterator[str]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield at(listener.getsockname()[1])


@contextmanager
def another_program() -> Iterator[str]:
    """Something that speaks, but not gRPC."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            while True:
                try:
                    connection, _ = listener.accept()
                except OSError:
                    return  # The listener was shut down: the test has ended.
                with connection:
                    connection.sendall(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n")

        thread = threading.Thread(target=serve, name="web-server")
        thread.start()
        try:
            yield at(listener.getsockname()[1])
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            thread.join(10)


# The second is a method that a robot may take its time over.
@pytest.mark.parametrize("asked", ["status", "enable"])
@pytest.mark.parametrize(
    ("place", "words"),
    [
        (nothing, "nothing listens there"),
        (a_hole, "no answer"),
        (no_such_name, "the name does not resolve"),
        (a_listener_that_says_nothing, "does not answer as a gateway"),
        (another_program, "speak gRPC|connection was closed"),
    ],
    ids=["nothing", "black-hole", "no-such-name", "mute", "no-grpc"],
)
def test_where_no_gateway_is_the_client_says_so_soon(
    face: type[Face], place: Callable[[], Any], words: str, asked: str
) -> None:
    with place() as target, face(target) as robot, taking(5):
        with pytest.raises(Unreachable, match=words) as seen:
            METHODS[asked](robot)
        assert target in seen.value.what
        assert "robot-gateway" in seen.value.remedy
        assert seen.value.exit_code is ExitCode.UNREACHABLE


def test_a_gateway_that_comes_later_is_found_by_the_same_client(
    face: type[Face], double: GatewayDouble
) -> None:
    port = free_tcp_port()
    with face(at(port)) as robot:
        with pytest.raises(Unreachable):
            robot.status()
        with serving(double, port):
            wait_until(lambda: answers(robot), "the gateway is found")
        with pytest.raises(Unreachable):
            robot.status()
        with serving(double, port):
            wait_until(lambda: answers(robot), "the gateway is found again")


def answers(robot: Face) -> bool:
    try:
        return bool(robot.status().gateway_name == "lab-1")
    except (Unreachable, DeadlineExceeded):
        return False


@pytest.mark.timed
def test_a_link_that_goes_silent_under_a_call_is_noticed(
    face: type[Face], port: int, double: GatewayDouble
) -> None:
    # A ping after 2 s, and 2 s for its answer, as without options.
    patient = ClientOptions(answer_within_s=60, connect_within_s=10)

    def noticed_after_s() -> float:
        with Relay(port) as relay, face(at(relay.port), patient) as robot:
            robot.status()
            double.hold.clear()
            relay.fall_silent()
            begun_s = time.monotonic()
            try:
                with pytest.raises(Unreachable, match="the link went silent"):
                    robot.status()
                return time.monotonic() - begun_s
            finally:
                double.hold.set()

    keeps(SILENCE_NOTICED_WITHIN_S, "s until a silent link is noticed under a call", noticed_after_s)


@pytest.mark.timed
def test_a_link_that_went_silent_between_calls_is_replaced(face: type[Face], port: int) -> None:
    patient = ClientOptions(answer_within_s=60, connect_within_s=10)

    def noticed_after_s() -> float:
        with Relay(port) as relay, face(at(relay.port), patient) as robot:
            robot.status()
            assert connections_to(relay.port) == 1
            relay.fall_silent()
            begun_s = time.monotonic()
            wait_until(lambda: connections_to(relay.port) == 0, "the dead connection is given up")
            took_s = time.monotonic() - begun_s
            assert robot.status().gateway_name == "lab-1"
            assert relay.connections == 2
            assert robot.retries == 0, "the call never met the dead connection"
        return took_s

    keeps(SILENCE_NOTICED_WITHIN_S, "s until a silent link is noticed between calls", noticed_after_s)


# --- answers that can't be read ---


@pytest.fixture
def gibberish() -> Iterator[int]:
    """The port of a server that answers each method with bytes that are no message."""
    service = robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"]
    handlers: dict[str, grpc.RpcMethodHandler[Any, Any]] = {
        method.name: grpc.unary_stream_rpc_method_handler(lambda _request, _context: iter([b"\xff"]))
        if method.server_streaming
        else grpc.unary_unary_rpc_method_handler(lambda _request, _context: b"\xff")
        for method in service.methods
    }
    with serving_handlers(grpc.method_handlers_generic_handler(service.full_name, handlers)) as port:
        yield port


def test_an_unreadable_answer_says_so(face: type[Face], gibberish: int, ask: Ask) -> None:
    with face(at(gibberish)) as robot, pytest.raises(GatewayFailed, match="sent an unreadable answer to"):
        ask(robot)


def test_an_unreadable_item_ends_the_stream(gibberish: int) -> None:
    with GatewayClient(at(gibberish)) as robot:
        for stream in (robot.events(), robot.watch_status()):
            with pytest.raises(GatewayFailed, match="sent an unreadable answer to"):
                next(stream)


# --- nothing is left ---


def connections_to(port: int) -> int:
    """This process's own, as the one who called."""
    mine = psutil.Process().net_connections("tcp")
    return sum(1 for one in mine if one.raddr and one.raddr.port == port)


def test_many_clients_leave_no_thread_and_no_socket(face: type[Face], port: int) -> None:
    closed: list[Face] = []
    hasty = replace(PATIENT, backoff=Backoff(give_up_after_s=0))

    def use_some(count: int) -> None:
        absent = at(free_tcp_port())
        for _ in range(count):
            with face(at(port)) as robot:
                robot.status()
            # Kept, so that closing is what frees them, not the end of the last reference.
            closed.append(robot)
            with face(absent, hasty) as robot, pytest.raises(Unreachable):
                robot.status()

    # gRPC's own threads and sockets, once per process.
    use_some(3)
    wait_until(lambda: connections_to(port) == 0, "the first clients are gone")
    files, native, python = open_files(), native_threads(), python_threads()
    use_some(20)
    wait_until(lambda: connections_to(port) == 0, "no connection is left")
    # A leak would be of 20 or 40.
    wait_until(lambda: open_files() < files + 10, f"{files} open files before")
    wait_until(lambda: native_threads() < native + 10, f"{native} threads before")
    wait_until(lambda: python_threads() <= python, f"{python} Python threads before")


def test_no_loop_of_a_closed_client_is_kept(port: int) -> None:
    """Each loop that a channel was used in is kept by gRPC, as long as there is a channel."""
    with Blocking(at(port)) as stays:
        stays.status()
        gc.collect()
        before = loops()
        for _ in range(5):
            with Blocking(at(port)) as goes:
                goes.status()
        gc.collect()
        assert loops() == before


def loops() -> int:
    return sum(isinstance(each, asyncio.AbstractEventLoop) for each in gc.get_objects())


def test_a_client_that_is_not_closed_goes_with_its_last_reference(port: int) -> None:
    with Blocking(at(port)) as stays:
        stays.status()
        abandoned = Blocking(at(port))
        abandoned.status()
        wait_until(lambda: connections_to(port) == 2, "both are connected")
        del abandoned
        gc.collect()
        wait_until(lambda: connections_to(port) == 1, "the connection of the abandoned one is closed")
        assert stays.status().gateway_name == "lab-1"


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def native_threads() -> int:
    return len(list(Path("/proc/self/task").iterdir()))


def python_threads() -> int:
    """Without those of the double's pool: it may begin another one late, and keeps it."""
    return sum(not each.name.startswith("ThreadPoolExecutor") for each in threading.enumerate())


def test_closing_one_client_does_not_hurt_another(face: type[Face], port: int, double: GatewayDouble) -> None:
    with face(at(port)) as stays:
        stays.status()
        with Blocking(at(port)) as goes:
            goes.status()
        assert stays.status().gateway_name == "lab-1"
        assert stays.retries == 0
    assert double.calls == ["GetSystemStatus"] * 3


def test_what_a_viewer_requests_and_reports_reaches_the_robot(face: type[Face]) -> None:
    double = StreamingGatewayDouble()
    report = PictureReport(viewer_id="left", picture_age_ms=140, delivery=PictureDelivery.DIRECT)
    with serving(double) as port, face(f"127.0.0.1:{port}") as robot:
        assert robot.request_key_frame(1 << 32).forced
        assert robot.report_picture(report) is None
    assert [each.newest_pts for each in double.key_frames_requested] == [1 << 32]
    assert [(each.viewer_id, each.picture_age_ms) for each in double.pictures] == [("left", 140)]


def test_a_gateway_that_knows_neither_is_unsupported(face: type[Face], port: int) -> None:
    with face(f"127.0.0.1:{port}") as robot:
        for call in (robot.request_key_frame, lambda: robot.report_picture(PictureReport(picture_age_ms=1))):
            with pytest.raises(Unsupported):
                call()
