"""The doctor's findings; the robot is a real server whose answers the test writes."""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import grpc
import pytest

from common.findings import Finding, Verdict
from common.version import project_version
from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.doctor import network, robot
from console.doctor.examination import examine, reached
from console.doctor.srt_probe import answers_as_srt, induction, is_answer
from omniseer.gateway.v1 import cloud_pb2, teleop_pb2
from omniseer.gateway.v1 import states_pb2 as states
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR, FAULT_SEVERITY_WARNING
from omniseer.gateway.v1.source_pb2 import SOURCE_STATE_QOS_MISMATCH, SOURCE_STATE_SILENT
from tests.support.gateway_double import GatewayDouble, serving


@pytest.fixture
def double() -> GatewayDouble:
    double = GatewayDouble()
    double.info.gateway_version = project_version()
    return double


def examined(double: GatewayDouble, *, ahead_s: float = 0.0) -> dict[str, Finding]:
    """All findings, by check; the robot's clock is ahead of ours by so much."""
    now_s = time.time()
    double.info.wall_clock_unix_ms = int((now_s + ahead_s) * 1000)
    with serving(double) as port:
        findings = list(examine(f"127.0.0.1:{port}", wall_clock=lambda: now_s))
    assert reached(findings)
    return {finding.check: finding for finding in findings}


def test_a_robot_that_is_well(double: GatewayDouble) -> None:
    findings = examined(double)
    assert {each.verdict for each in findings.values()} == {Verdict.GOOD}
    assert "encoder" not in findings, "a preview that is off proves none"
    assert {"name", "tcp", "grpc", "version", "clock", "calls", "health"} <= set(findings)


@pytest.mark.parametrize(("ahead_s", "word"), [(90.0, "ahead of"), (-90.0, "behind")])
def test_a_clock_that_is_wrong_says_which_way(double: GatewayDouble, ahead_s: float, word: str) -> None:
    finding = examined(double, ahead_s=ahead_s)["clock"]
    assert finding.verdict is Verdict.WRONG
    assert word in finding.what
    assert "timedatectl" in finding.remedy


def test_a_slow_answer_does_not_accuse_a_clock() -> None:
    assert robot.clock_finding(100.0, 103.0, uncertainty_s=2.5).verdict is Verdict.GOOD
    assert robot.clock_finding(100.0, 103.0, uncertainty_s=1.5).verdict is Verdict.WRONG


def test_another_version_is_worth_a_note(double: GatewayDouble) -> None:
    double.info.gateway_version = "0.0.1"
    finding = examined(double)["version"]
    assert (finding.verdict, "0.0.1" in finding.what) == (Verdict.NOTE, True)


def test_an_older_gateway_is_examined_all_the_same() -> None:
    class Old(GatewayDouble):
        def GetGatewayInfo(self, _request: object, context: grpc.ServicerContext) -> None:  # type: ignore[override]  # noqa: N802
            context.abort(grpc.StatusCode.UNIMPLEMENTED, "no such method")

    findings = examined(Old())
    assert findings["version"].verdict is Verdict.NOTE
    assert "older" in findings["version"].what
    assert findings["health"].verdict is Verdict.GOOD
    assert "clock" not in findings


def test_a_source_that_is_visible_and_silent_is_named_once(double: GatewayDouble) -> None:
    double.status.sources.add(name="odometry", state=SOURCE_STATE_SILENT, detail="offered, nothing arrived")
    double.status.sources.add(name="battery", state=SOURCE_STATE_QOS_MISMATCH, detail="other guarantees")
    double.status.faults.add(
        id="odometry.silent",
        active=True,
        severity=FAULT_SEVERITY_ERROR,
        message="offered, nothing arrived",
        remedy="look at it",
    )
    findings = examined(double)
    assert findings["fault.odometry.silent"].verdict is Verdict.WRONG
    assert findings["fault.odometry.silent"].remedy == "look at it"
    assert "source.odometry" not in findings
    assert "reliability" in findings["source.battery"].remedy


@pytest.mark.parametrize("faulted", [True, False])
def test_one_condition_is_one_finding(double: GatewayDouble, *, faulted: bool) -> None:
    double.status.health.ready = False
    double.status.health.summary = "odometry stale"
    if faulted:
        double.status.faults.add(id="odometry.stale", active=True, severity=FAULT_SEVERITY_ERROR)
    wrong = [check for check, each in examined(double).items() if each.verdict is Verdict.WRONG]
    assert wrong == ["fault.odometry.stale" if faulted else "health"]


def test_an_encoder_in_software_is_a_note(double: GatewayDouble) -> None:
    double.status.faults.add(
        id="preview.fallback",
        active=True,
        severity=FAULT_SEVERITY_WARNING,
        message="x264 encodes",
        remedy="No hardware encoder here? Set encoders.order: [x264]",
    )
    finding = examined(double)["fault.preview.fallback"]
    assert finding.verdict is Verdict.NOTE
    assert finding.remedy == "No hardware encoder here? Set encoders.order: [x264]"


def test_a_cleared_fault_is_not_reported(double: GatewayDouble) -> None:
    double.status.faults.add(id="odometry.stale", message="stopped coming", cleared_age_ms=10)
    assert "fault.odometry.stale" not in examined(double)


def test_a_gateway_that_failed_calls_is_wrong(double: GatewayDouble) -> None:
    double.info.methods.add(method="GetSystemStatus", served=9, failed=2)
    assert examined(double)["calls"].what.startswith("2 calls ended")


def test_a_running_preview_behind_a_firewall(double: GatewayDouble) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        double.status.preview.state = states.PREVIEW_RUNNING
        double.status.preview.encoder.name = "x264"
        double.status.preview.endpoint.host = "127.0.0.1"
        double.status.preview.endpoint.port = deaf.getsockname()[1]
        findings = examined(double)
    assert findings["encoder"].verdict is Verdict.GOOD
    assert findings["stream"].verdict is Verdict.WRONG
    assert "firewall" in findings["stream"].why


def test_a_running_preview_that_answers() -> None:
    with srt_listener() as port:
        assert network.stream_finding("127.0.0.1", port).verdict is Verdict.GOOD


def test_nothing_listens() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, not listening: refused
        name, tcp = examine(f"127.0.0.1:{taken.getsockname()[1]}")
    assert not reached([name, tcp])
    assert (name.verdict, tcp.verdict) == (Verdict.GOOD, Verdict.WRONG)
    assert "robot-gateway doctor" in tcp.remedy


def test_a_name_that_leads_nowhere_ends_it() -> None:
    (name,) = examine("no-such-robot.invalid:50051")
    assert name.verdict is Verdict.WRONG
    assert "getent" in name.remedy


def test_something_else_listens_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        findings = list(examine(f"127.0.0.1:{server.getsockname()[1]}"))
    assert [finding.check for finding in findings] == ["name", "tcp", "grpc"]
    assert findings[-1].verdict is Verdict.WRONG
    assert not reached(findings)


def test_an_address_with_brackets_is_split() -> None:
    assert network.split("[fe80::1]:50051") == ("fe80::1", 50051)


def test_packets_that_are_no_answer() -> None:
    assert not is_answer(b"")
    assert not is_answer(induction())
    assert not is_answer(bytes(64))


def test_a_closed_port_is_known_at_once() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        port = gone.getsockname()[1]
    assert not answers_as_srt("127.0.0.1", port)


@contextmanager
def srt_listener() -> Iterator[int]:
    """Answers the first packet of a handshake as libsrt does, and loses the first one it gets."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5)

        def serve() -> None:
            listener.recv(2048)
            asked, caller = listener.recvfrom(2048)
            answer = bytearray(asked)
            answer[12:16] = asked[40:44]  # to the caller's id
            answer[16:20] = (5).to_bytes(4, "big")
            answer[22:24] = (0x4A17).to_bytes(2, "big")
            answer[44:48] = b"cook"
            listener.sendto(answer, caller)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            thread.join()


def test_a_resolver_that_hangs_does_not_keep_the_program() -> None:
    program = """
import socket, sys, threading
from console.doctor import network

network._WITHIN_S = 0.1
socket.getaddrinfo = lambda *_args, **_more: threading.Event().wait()
print(network.name_finding("lab1.local").what)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=True
    )
    assert done.stdout == "'lab1.local' does not resolve: no answer within 0.1 s\n"


def test_a_robot_that_is_not_set_up_for_driving_has_no_finding_of_it(double: GatewayDouble) -> None:
    assert "driving" not in examined(double)


def test_what_keeps_a_robot_from_being_driven_is_found(double: GatewayDouble) -> None:
    teleop = double.status.teleop
    teleop.state, teleop.enabled, teleop.holder = states.TELEOP_ENABLED, True, "anna"
    assert "anna drives" in examined(double)["driving"].what
    teleop.inhibits.append(teleop_pb2.DRIVE_INHIBIT_BASE_ABSENT)
    found = examined(double)["driving"]
    assert (found.verdict, found.remedy) == (Verdict.NOTE, "Type on the robot: robot-drive doctor")
    teleop.stop.stop_id, teleop.stop.by = 7, "ben"
    assert "reset-stop 7" in examined(double)["driving"].remedy
    assert examined(double)["driving.base"].verdict is Verdict.NOTE, "a stop changes nothing about the base"
    teleop.base_timeout_ms = 250
    assert "250 ms" in examined(double)["driving.base"].what
    teleop.Clear()
    teleop.state = states.TELEOP_DISABLED
    assert "disabled" in examined(double)["driving"].what
    assert examined(double)["driving.base"].verdict is Verdict.NOTE
    teleop.base_timeout_ms = 500
    assert "500 ms" in examined(double)["driving.base"].what
    teleop.inhibits.append(teleop_pb2.DRIVE_INHIBIT_DRIVE_LOST)
    assert "robot-drive" in examined(double)["driving"].remedy
    teleop.enabled, teleop.inhibits[:] = True, [teleop_pb2.DRIVE_INHIBIT_OUTRANKED]
    assert "what else drives" in examined(double)["driving"].remedy


def of_driving(double: GatewayDouble) -> list[Finding]:
    """The findings on driving, but on the base's timeout."""
    status = GET_SYSTEM_STATUS.decode(double.status.SerializeToString())
    return [finding for finding in robot.driving_findings(status) if finding.check == "driving"]


ROBOTS_OWN = [
    teleop_pb2.DRIVE_INHIBIT_ROBOT_STOP,
    teleop_pb2.DRIVE_INHIBIT_BASE_ABSENT,
    teleop_pb2.DRIVE_INHIBIT_OUTRANKED,
    teleop_pb2.DRIVE_INHIBIT_DRIVE_LOST,
]


@pytest.mark.parametrize("holder", ["", "anna"])
@pytest.mark.parametrize("inhibit", ROBOTS_OWN)
def test_a_robot_that_moves_for_no_driver_is_never_found_good(
    double: GatewayDouble, inhibit: teleop_pb2.DriveInhibit.ValueType, holder: str
) -> None:
    teleop = double.status.teleop
    teleop.state, teleop.enabled, teleop.holder = states.TELEOP_ENABLED, True, holder
    teleop.inhibits.append(inhibit)
    assert [found.verdict for found in of_driving(double)] == [Verdict.NOTE]


def test_a_driver_who_has_lost_access_keeps_no_other_from_driving(double: GatewayDouble) -> None:
    teleop = double.status.teleop
    teleop.state, teleop.enabled = states.TELEOP_ENABLED, True
    teleop.inhibits.append(teleop_pb2.DRIVE_INHIBIT_ACCESS_ENDED)
    assert [found.verdict for found in of_driving(double)] == [Verdict.GOOD]
    teleop.inhibits.append(teleop_pb2.DRIVE_INHIBIT_ROBOT_STOP)
    assert [found.verdict for found in of_driving(double)] == [Verdict.NOTE]


def test_no_fault_of_driving_stands_beside_a_robot_that_can_be_driven(double: GatewayDouble) -> None:
    teleop = double.status.teleop
    teleop.state, teleop.enabled = states.TELEOP_ENABLED, True
    fault = double.status.faults.add(id="drive.base", severity=FAULT_SEVERITY_WARNING, active=True)
    fault.message = "the robot can't be driven: nothing takes the velocities"
    found = examined(double)
    assert found["fault.drive.base"].verdict is Verdict.WRONG
    assert "driving" not in found
    fault.active = False
    assert examined(double)["driving"].verdict is Verdict.GOOD


def test_driving_that_is_disabled_is_found_beside_the_robots_own_reasons(double: GatewayDouble) -> None:
    teleop = double.status.teleop
    teleop.state = states.TELEOP_DISABLED
    teleop.inhibits.append(teleop_pb2.DRIVE_INHIBIT_ROBOT_STOP)
    assert [found.remedy for found in of_driving(double)] == [
        "Release the robot's own stop",
        "Type: robotctl drive --enable",
    ]


def test_a_robot_of_a_fleet_says_whether_it_is_connected(double: GatewayDouble) -> None:
    assert "fleet" not in examined(double)
    cloud = double.status.cloud
    cloud.state, cloud.robot, cloud.fleet = cloud_pb2.CLOUD_STATE_CONNECTED, "lab-1", "lab"
    connected = examined(double)["fleet"]
    assert (connected.verdict, connected.what) == (
        Verdict.GOOD,
        "connected to its hub as lab-1 in the fleet lab",
    )
    cloud.state, cloud.last_error, cloud.outbox_events = cloud_pb2.CLOUD_STATE_OFFLINE, "no route", 7
    cloud.uploads_waiting, cloud.uploads_paused = 2, "not charging"
    away = examined(double)
    assert (away["fleet"].verdict, "(7)" in away["fleet"].why) == (Verdict.NOTE, True)
    assert "not charging" in away["fleet.uploads"].what
    assert "fleet.queue" not in away
    cloud.uploads_left_out = 3
    assert "3 recordings" in examined(double)["fleet.queue"].what
    double.status.faults.add(id="cloud.offline", severity=FAULT_SEVERITY_WARNING, active=True)
    assert "fleet" not in examined(double), "the fault says it"
