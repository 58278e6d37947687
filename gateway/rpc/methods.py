"""What the schema says of each method: its messages, and the role that a caller needs."""

from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Final, TypeAlias

from google.protobuf import descriptor_pool
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

from gateway.access.role import Role
from omniseer.gateway.v1.access_pb2 import ROLE_ADMIN, ROLE_OPERATOR, ROLE_VIEWER, required_role
from omniseer.gateway.v1.robot_gateway_pb2 import DESCRIPTOR

CONTRACT: Final = DESCRIPTOR.services_by_name["RobotGateway"]
"""The operator's service."""


class Open(Enum):
    """Requirements that are not a role."""

    EVERYBODY = "everybody"
    """No credential is needed."""
    NOBODY = "nobody"
    """The method declares no role: no credential suffices."""


Needed: TypeAlias = Role | Open

ROLES: Final = {ROLE_VIEWER: Role.VIEWER, ROLE_OPERATOR: Role.OPERATOR, ROLE_ADMIN: Role.ADMIN}
STANDARD: Final[dict[str, Needed]] = {
    # Shows only that the gateway runs, as its open port does. What restarts a container has no credential.
    "grpc.health.v1.Health": Open.EVERYBODY,
    # Shows what this gateway can do, as its documentation does.
    "grpc.reflection.v1alpha.ServerReflection": Role.VIEWER,
    "grpc.reflection.v1.ServerReflection": Role.VIEWER,
}
"""By the service's full name."""


@dataclass(frozen=True, slots=True)
class Method:
    """One method of one service.

    Attributes:
        name: without its service, "Ping" for example. needed: what a caller needs. of_contract: whether the
        method belongs to the operator's contract, so that it is counted and validated. request_type: of the
        contract's methods; None for others.
    """

    name: str
    needed: Needed
    of_contract: bool = False
    request_type: type[Message] | None = None

    @property
    def changes_robot(self) -> bool:
        """Whether it is a control action: a method of the contract that a viewer may not call."""
        return self.of_contract and self.needed is not Role.VIEWER


@cache
def method_at(path: str) -> Method:
    """Returns the method at a path on the wire, "/omniseer.gateway.v1.RobotGateway/Ping" for example.

    Bounded: only paths that have a handler are asked for.
    """
    service, _, name = path.removeprefix("/").partition("/")
    if service in STANDARD:
        return Method(name, STANDARD[service])
    try:
        found = descriptor_pool.Default().FindMethodByName(f"{service}.{name}")
    except KeyError:
        return Method(name, Open.NOBODY)
    needed = ROLES.get(found.GetOptions().Extensions[required_role], Open.NOBODY)
    of_contract = found.containing_service.file.package == DESCRIPTOR.package
    return Method(name, needed, of_contract, GetMessageClass(found.input_type) if of_contract else None)
