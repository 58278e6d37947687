"""What the bridge refuses."""

from typing import Final

import grpc

from common.errors import (
    BridgeUnreachableError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    TooMuchError,
)
from common.reasons import Reason
from gateway.links.refusals import Refusals


def unreachable(why: str) -> BridgeUnreachableError:
    """Returns the error of a bridge that does not answer."""
    return BridgeUnreachableError(
        f"the robot's bridge to its fleet does not answer ({why}); recordings stay on the robot"
    )


REFUSALS: Final = Refusals(
    "the robot's bridge",
    {
        grpc.StatusCode.NOT_FOUND: (NotFoundError, Reason.RECORDING_NOT_FOUND),
        grpc.StatusCode.FAILED_PRECONDITION: (PreconditionError, Reason.RECORDING_RUNS),
        grpc.StatusCode.RESOURCE_EXHAUSTED: (TooMuchError, Reason.TOO_MANY_UPLOADS),
        grpc.StatusCode.INVALID_ARGUMENT: (
            lambda text, _: InvalidRequestError(text),
            Reason.INVALID_REQUEST,
        ),
    },
    unreachable,
)
