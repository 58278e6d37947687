"""What it takes to call a method: read from the schema for ours, said here for the standard services."""

from enum import Enum
from typing import Final, TypeAlias

from google.protobuf import descriptor_pool

from gateway.access.role import Role
from omniseer.gateway.v1.access_pb2 import ROLE_ADMIN, ROLE_OPERATOR, ROLE_VIEWER, required_role


class Open(Enum):
    """What no role says."""

    EVERYBODY = "everybody"
    """No credential is needed."""
    NOBODY = "nobody"
    """No credential is enough: the method declares no role."""


Needed: TypeAlias = Role | Open

ROLES: Final = {ROLE_VIEWER: Role.VIEWER, ROLE_OPERATOR: Role.OPERATOR, ROLE_ADMIN: Role.ADMIN}
STANDARD: Final[dict[str, Needed]] = {
    # Tells nothing but that the gateway is there, which its open port tells as well. What restarts a
    # container has no credential.
    "grpc.health.v1.Health": Open.EVERYBODY,
    # Tells what this gateway can do, as its documentation does.
    "grpc.reflection.v1alpha.ServerReflection": Role.VIEWER,
    "grpc.reflection.v1.ServerReflection": Role.VIEWER,
}
"""By the service's full name."""


def needed_for(method: str) -> Needed:
    """What a caller needs.

    Args:
        method: its address on the wire, "/omniseer.gateway.v1.RobotGateway/Ping" for example.
    """
    service, _, name = method.removeprefix("/").partition("/")
    if service in STANDARD:
        return STANDARD[service]
    try:
        found = descriptor_pool.Default().FindMethodByName(f"{service}.{name}")
    except KeyError:
        return Open.NOBODY
    return ROLES.get(found.GetOptions().Extensions[required_role], Open.NOBODY)
