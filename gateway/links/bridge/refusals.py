"""What the bridge refuses."""

from typing import Final

import grpc

from common.errors import (
    BridgeUnreachableError,
    PreconditionError,
    TooMuchError,
)
from common.reasons import Reason
from gateway.links.refusals import OF_ANY_SERVICE, Refusals


def unreachable(why: str) -> BridgeUnreachableError:
    """Returns the error of a bridge that does not answer."""
    return BridgeUnreachableError(
        f"the robot's bridge to its fleet does not answer ({why}); recordings stay on the robot"
    )


REFUSALS: Final = Refusals(
    "the robot's bridge",
    {
        **OF_ANY_SERVICE,
        grpc.StatusCode.FAILED_PRECONDITION: (PreconditionError, Reason.RECORDING_RUNS),
        grpc.StatusCode.RESOURCE_EXHAUSTED: (TooMuchError, Reason.TOO_MANY_UPLOADS),
    },
    unreachable,
)
