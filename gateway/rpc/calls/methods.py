"""What the schema says of each method: its messages, and the role that a caller needs."""

from enum import Enum
from typing import Final, TypeAlias

from google.protobuf import descriptor_pool
from google.protobuf.descriptor import MethodDescriptor
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

from common import interceptors
from gateway.access.role import Role
from omniseer.gateway.v1 import recording_pb2, teleop_pb2
from omniseer.gateway.v1.access_pb2 import ROLE_ADMIN, ROLE_OPERATOR, ROLE_VIEWER, required_role
from omniseer.gateway.v1.robot_gateway_pb2 import DESCRIPTOR

CONTRACT: Final = DESCRIPTOR.services_by_name["RobotGateway"]
"""The operator's first service, by whose name the health service knows the gateway."""
TELEOP: Final = teleop_pb2.DESCRIPTOR.services_by_name["TeleopService"]
RECORDING: Final = recording_pb2.DESCRIPTOR.services_by_name["RecordingService"]
SERVICES: Final = (CONTRACT, TELEOP, RECORDING)
"""All services of the operators' contract. Their methods have names of their own."""
STOP_ROBOT: Final = "StopRobot"
"""Exempt from every limit for those who may call it: it must work when nothing else does. The only control
action of viewers."""


class Open(Enum):
    """Requirements that are not a role."""

    PUBLIC = "anyone"
    """No credential is needed."""
    UNDECLARED = "no one"
    """The method declares no role: no credential suffices."""


Needed: TypeAlias = Role | Open

ROLES: Final = {ROLE_VIEWER: Role.VIEWER, ROLE_OPERATOR: Role.OPERATOR, ROLE_ADMIN: Role.ADMIN}
STANDARD: Final[dict[str, Needed]] = {
    # Shows only that the gateway runs, as its open port does. What restarts a container has no credential.
    "grpc.health.v1.Health": Open.PUBLIC,
    # Shows what this gateway can do, as its documentation does.
    "grpc.reflection.v1alpha.ServerReflection": Role.VIEWER,
    "grpc.reflection.v1.ServerReflection": Role.VIEWER,
}
"""By the service's full name."""


class Method(interceptors.Method):
    """One method, as the schema describes it.

    Attributes:
        name: without its service, "Ping" for example.
        key: unique name for statistics: `name` in the operators' contract, else "package.Service/Method".
        needed: what a caller needs.
        of_contract: whether it belongs to the operators' contract, so that it is counted and validated.
        unlimited: whether no limit on calls, streams and connections applies, where the caller is known.
        request_type: of the contract's methods; None for others.
        response_type: the same.
        has_parameters: whether the request has fields, and so possibly rules.
    """

    request_type: type[Message] | None
    response_type: type[Message] | None

    def __init__(
        self, path: str, *, request_streaming: bool = False, response_streaming: bool = False
    ) -> None:
        super().__init__(path, request_streaming=request_streaming, response_streaming=response_streaming)
        service, _, self.name = path.removeprefix("/").partition("/")
        of_operators = any(service == each.full_name for each in SERVICES)
        self.key = self.name if of_operators else f"{service}/{self.name}"
        self.needed: Needed = STANDARD.get(service, Open.UNDECLARED)
        self.of_contract = False
        self.request_type = self.response_type = None
        self.has_parameters = False
        self.unlimited = service == TELEOP.full_name and self.name == STOP_ROBOT
        found = _described(service, self.name)
        if found is not None:
            self.needed = ROLES.get(found.GetOptions().Extensions[required_role], Open.UNDECLARED)
            self.of_contract = found.containing_service.file.package == DESCRIPTOR.package
        if found is not None and self.of_contract:
            self.request_type = GetMessageClass(found.input_type)
            self.response_type = GetMessageClass(found.output_type)
            self.has_parameters = bool(found.input_type.fields)

    @property
    def changes_robot(self) -> bool:
        """Whether it is a control action: one that a viewer may not call, or the stop, which a viewer may."""
        return self.of_contract and (self.needed is not Role.VIEWER or self.unlimited)


def _described(service: str, name: str) -> MethodDescriptor | None:
    """Returns what the schema says; None for the standard services and for unknown methods."""
    if service in STANDARD:
        return None
    try:
        return descriptor_pool.Default().FindMethodByName(f"{service}.{name}")
    except KeyError:
        return None
