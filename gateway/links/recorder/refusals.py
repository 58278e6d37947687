"""What the recorder refuses."""

from typing import Final

import grpc

from common.errors import (
    ConflictError,
    DamagedError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
)
from common.reasons import Reason
from gateway.links.refusals import Refusals


def unreachable(why: str) -> RecorderUnreachableError:
    """Returns the error of a recorder that does not answer."""
    return RecorderUnreachableError(
        f"the robot's recorder does not answer ({why}); what it records at present goes on"
    )


REFUSALS: Final = Refusals(
    "the robot's recorder",
    {
        grpc.StatusCode.NOT_FOUND: (NotFoundError, Reason.RECORDING_NOT_FOUND),
        grpc.StatusCode.FAILED_PRECONDITION: (PreconditionError, Reason.RECORDER_NOT_READY),
        grpc.StatusCode.ABORTED: (ConflictError, Reason.RECORDING_CHANGED),
        grpc.StatusCode.RESOURCE_EXHAUSTED: (TooMuchError, Reason.DISK_FULL),
        grpc.StatusCode.INVALID_ARGUMENT: (
            lambda text, _: InvalidRequestError(text),
            Reason.INVALID_REQUEST,
        ),
        grpc.StatusCode.DATA_LOSS: (lambda text, _: DamagedError(text), Reason.RECORDING_DAMAGED),
    },
    unreachable,
)
