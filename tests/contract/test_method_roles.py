"""Every method says who may call it; what says nothing is served to no caller; the page says the same."""

import re
from pathlib import Path

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool
from grpc_health.v1.health import SERVICE_NAME as HEALTH
from grpc_reflection.v1alpha.reflection import SERVICE_NAME as REFLECTION

from gateway.access.role import Role
from gateway.rpc.calls.methods import ROLES, STANDARD, Method, Open
from omniseer.gateway.v1 import recording_pb2, robot_gateway_pb2, teleop_pb2
from omniseer.gateway.v1.access_pb2 import ROLE_UNSPECIFIED
from omniseer.gateway.v1.access_pb2 import Role as WireRole

SERVICES = (
    robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"],
    teleop_pb2.DESCRIPTOR.services_by_name["TeleopService"],
    recording_pb2.DESCRIPTOR.services_by_name["RecordingService"],
)
PAGE = (Path(__file__).parents[2] / "docs/security.md").read_text(encoding="utf-8")


def undeclared(service: str, names: list[str]) -> list[str]:
    """Methods that no caller may use, because their schema says nothing."""
    return [name for name in names if Method(f"/{service}/{name}").needed is Open.UNDECLARED]


def test_every_method_declares_a_role() -> None:
    for service in SERVICES:
        assert undeclared(service.full_name, [method.name for method in service.methods]) == []


@pytest.fixture
def forgetful(monkeypatch: pytest.MonkeyPatch) -> str:
    """A service whose author forgot it; its name."""
    file = descriptor_pb2.FileDescriptorProto(name="forgetful.proto", package="forgetful", syntax="proto3")
    file.message_type.add(name="Empty")
    service = file.service.add(name="Forgetful")
    service.method.add(name="Anything", input_type=".forgetful.Empty", output_type=".forgetful.Empty")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    monkeypatch.setattr(descriptor_pool, "Default", lambda: pool)
    return "forgetful.Forgetful"


def test_the_test_would_notice_one_that_does_not(forgetful: str) -> None:
    assert undeclared(forgetful, ["Anything", "Other"]) == ["Anything", "Other"]


def test_every_role_of_the_schema_is_one_of_ours() -> None:
    assert set(ROLES) == set(WireRole.values()) - {ROLE_UNSPECIFIED}
    assert set(ROLES.values()) == set(Role)


def test_the_standard_services_that_are_served_have_a_rule() -> None:
    assert STANDARD[HEALTH] is Open.PUBLIC
    assert STANDARD[REFLECTION] is Role.VIEWER


def test_the_page_says_the_same() -> None:
    table = PAGE.split("| method | role |")[1].split("\n\n")[0]
    said = dict(re.findall(r"^\| `([^`]+)` \| (\w+) \|$", table, re.MULTILINE))
    ours = {
        method.name: Method(f"/{service.full_name}/{method.name}").needed.value
        for service in SERVICES
        for method in service.methods
    }
    assert said == ours | {service: needed.value for service, needed in STANDARD.items()}
