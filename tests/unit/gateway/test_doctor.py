"""The robot's doctor: findings of devices, endpoints, credentials and configuration."""

import os
import socket
from pathlib import Path
from typing import Any

import pytest

from common.findings import Finding, Verdict
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.role import Role
from gateway.config import GatewaySettings
from gateway.doctor.devices import device_findings
from gateway.doctor.endpoints import (
    BRIDGE,
    DRIVE,
    PREVIEW,
    RECORDER,
    Service,
    operator_endpoint,
    service_endpoint,
)
from gateway.doctor.examination import examine
from gateway.links.preview.exposure import video_exposure
from gateway.status.preview import Listener
from tests.support.preview_double import Behaviour, double_process


def test_a_configuration_that_is_wrong_ends_it(tmp_path: Path) -> None:
    config = tmp_path / "gateway.yaml"
    config.write_text("grpc: {prot: 1}\n", encoding="utf-8")
    (finding,) = examine(config)
    assert (finding.check, finding.verdict) == ("configuration", Verdict.WRONG)
    assert "grpc.prot" in finding.what


def test_a_gateway_without_sources_needs_no_ros(tmp_path: Path) -> None:
    config = tmp_path / "gateway.yaml"
    config.write_text("sources: []\n", encoding="utf-8")
    findings: dict[str, Finding] = {finding.check: finding for finding in examine(config)}
    assert findings["configuration"].verdict is Verdict.GOOD
    assert findings["ros"].what == "no sources are configured; ROS is not used"


def test_what_the_hub_may_request_is_named_and_must_be_possible(tmp_path: Path) -> None:
    config = tmp_path / "gateway.yaml"

    def finding(text: str) -> Finding | None:
        config.write_text(f"sources: []\n{text}\n", encoding="utf-8")
        return next((each for each in examine(config) if each.check == "bridge.requests"), None)

    assert finding("") is None
    none = finding("bridge: {socket: /run/b.sock}")
    assert none
    assert (none.verdict, none.what) == (Verdict.GOOD, "the fleet's hub may request: nothing")
    both = "bridge: {socket: /run/b.sock, allowed_requests: [upload, snapshot]}"
    named = finding(f"{both}\nrecording: {{socket: /run/r.sock}}")
    assert named
    assert named.what.endswith("upload, snapshot")
    for text, missing in (
        (both, "recording.socket"),
        ("bridge: {allowed_requests: [upload]}", "bridge.socket"),
    ):
        wrong = finding(text)
        assert wrong
        assert (wrong.verdict, missing in wrong.what) == (Verdict.WRONG, True)


def test_a_machine_without_devices_is_worth_a_note(tmp_path: Path) -> None:
    (finding,) = device_findings(tmp_path)
    assert finding.verdict is Verdict.NOTE


def test_devices_of_every_family_are_looked_at(tmp_path: Path) -> None:
    for name in ("video11", "dri/renderD128", "mpp_service", "rga", "dma_heap/system", "nvidia0", "null"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.touch()
    findings = {finding.check: finding for finding in device_findings(tmp_path)}
    assert set(findings) == {
        f"device.{name}" for name in ("video11", "renderD128", "mpp_service", "rga", "system", "nvidia0")
    }
    assert {finding.verdict for finding in findings.values()} == {Verdict.GOOD}


def test_a_device_of_another_group_says_which(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Root may everything: the kernel's answer is put in its place.
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    device = tmp_path / "video11"
    device.touch(mode=0o660)
    (finding,) = device_findings(tmp_path)
    assert finding.verdict is Verdict.WRONG
    assert f"usermod -aG {device.group()} $USER" in finding.remedy


def test_the_operators_endpoint() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert operator_endpoint("127.0.0.1", port).verdict is Verdict.GOOD
        assert operator_endpoint("0.0.0.0", port).verdict is Verdict.GOOD  # noqa: S104  # binds nothing
    assert operator_endpoint("127.0.0.1", port).verdict is Verdict.NOTE
    assert operator_endpoint("127.0.0.1", 0).verdict is Verdict.NOTE


@pytest.mark.parametrize("service", [PREVIEW, DRIVE, RECORDER, BRIDGE], ids=lambda service: service.check)
def test_the_endpoint_of_a_service(tmp_path: Path, service: Service) -> None:
    path = tmp_path / "service.sock"
    assert f"{service.program} serve" in service_endpoint(service, path).remedy
    assert f"directory {tmp_path / 'gone'}" in service_endpoint(service, tmp_path / "gone/a.sock").remedy
    with socket.socket(socket.AF_UNIX, service.kind) as server:
        server.bind(str(path))
        server.listen()
        assert service_endpoint(service, path).verdict is Verdict.GOOD
    left_over = service_endpoint(service, path)
    assert (left_over.verdict, "left over" in left_over.what) == (Verdict.WRONG, True)
    assert f"Start {service.name} again" in left_over.remedy
    path.unlink()
    path.write_text("no socket", encoding="utf-8")
    assert service_endpoint(service, path).verdict is Verdict.WRONG


@pytest.mark.parametrize(
    ("check", "section", "remedy"),
    [
        (
            "drive",
            "teleop: {socket: a.sock, allow_insecure: true}",
            "Start the drive program: robot-drive serve",
        ),
        ("recording", "recording: {socket: a.sock}", "Start the recorder: robot-recorder serve"),
    ],
    ids=["drive", "recording"],
)
def test_a_program_is_looked_for_where_it_is_configured(
    tmp_path: Path, check: str, section: str, remedy: str
) -> None:
    config, sections = tmp_path / "gateway.yaml", section.replace("a.sock", f"{tmp_path}/a.sock")
    for content, checked in (("sources: []\n", False), (f"sources: []\n{sections}\n", True)):
        config.write_text(content, encoding="utf-8")
        found = {finding.check: finding for finding in examine(config)}
        assert (check in found) is checked
    assert (found[check].verdict, found[check].remedy) == (Verdict.WRONG, remedy)


def access_of(tmp_path: Path) -> Finding:
    config = tmp_path / "gateway.yaml"
    config.write_text(f"sources: []\nsecurity: {{credentials: {tmp_path / 'c'}}}\n", encoding="utf-8")
    return {finding.check: finding for finding in examine(config)}["access"]


def test_credentials_are_looked_at_as_the_gateway_does(tmp_path: Path) -> None:
    missing = access_of(tmp_path)
    assert missing.verdict is Verdict.WRONG
    assert "robot-gateway credentials init" in missing.remedy
    admin = CredentialAdmin(CredentialDirectory(tmp_path / "c"), "lab")
    admin.initialize(("localhost",))
    assert access_of(tmp_path).verdict is Verdict.NOTE
    admin.add(CredentialRequest("anna", Role.VIEWER))
    assert access_of(tmp_path).what.startswith("valid credentials: 1; the certificate is valid until 2")
    (tmp_path / "c/server-key.pem").write_text("no key", encoding="utf-8")
    assert access_of(tmp_path).verdict is Verdict.WRONG


@pytest.mark.parametrize(
    ("security", "preview", "address", "verdict", "words"),
    [
        ({}, {}, "0.0.0.0", Verdict.GOOD, "is encrypted; its listener is at 0.0.0.0, UDP port 7100"),  # noqa: S104  # data
        ({}, {}, "::", Verdict.GOOD, "is encrypted; its listener is at [::], UDP port 7100"),
        ({}, {}, "", Verdict.GOOD, "is encrypted; its listener is at an unknown address, UDP port 7100"),
        ({}, {}, "127.0.0.1", Verdict.GOOD, "is for this machine alone. Docker before 28"),
        ({}, {"encrypted": True}, "127.0.0.1", Verdict.GOOD, "is encrypted"),
        ({}, {"encrypted": False}, "127.0.0.1", Verdict.GOOD, "is for this machine alone. Docker before 28"),
        ({}, {"encrypted": False}, "10.0.0.5", Verdict.NOTE, "preview.encrypted is false"),
        ({"insecure": True}, {}, "10.0.0.5", Verdict.NOTE, "security.insecure is set"),
        ({"insecure": True}, {"encrypted": False}, "10.0.0.5", Verdict.NOTE, "preview.encrypted is false"),
        ({"credentials": "/c"}, {"encrypted": False}, "10.0.0.5", Verdict.NOTE, "preview.encrypted is false"),
    ],
)
def test_whether_the_video_is_encrypted(
    *, security: dict[str, Any], preview: dict[str, Any], address: str, verdict: Verdict, words: str
) -> None:
    settings = GatewaySettings.model_validate({"security": security, "preview": preview})
    finding = video_exposure(settings, Listener(7100, 125, address))
    assert finding.verdict is verdict
    assert words in f"{finding.what} ({finding.why})"
    if verdict is not Verdict.GOOD:
        assert "PREVIEW_BIND=127.0.0.1" in finding.remedy


@pytest.mark.parametrize("behaviour", ["works", "reports-an-unknown-state"])
def test_the_doctor_asks_the_service_where_its_listener_is(tmp_path: Path, behaviour: str) -> None:
    config, socket_path = tmp_path / "gateway.yaml", tmp_path / "preview.sock"
    config.write_text(f"{{sources: [], preview: {{socket: {socket_path}}}}}", encoding="utf-8")
    assert "video" not in {finding.check for finding in examine(config)}, "there is nothing to ask"
    with double_process(socket_path, Behaviour(behaviour)):
        (finding,) = (each for each in examine(config) if each.check == "video")
    if behaviour == "works":
        assert finding.what.startswith(
            "the video is not encrypted; its listener at 127.0.0.1, UDP port 7100 is for this machine alone"
        )
    else:
        assert finding.verdict is Verdict.NOTE
        assert "unknown state" in finding.what
