"""What the recorder refuses."""

from typing import Final

import grpc

from common.errors import (
    ConflictError,
    DamagedError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
)
from common.reasons import Reason
from gateway.links.refusals import OF_ANY_SERVICE, Refusals


def unreachable(why: str) -> RecorderUnreachableError:
    """Returns the error of a recorder that does not answer."""
    return RecorderUnreachableError(
        f"the robot's recorder does not answer ({why}); what it records at present goes on"
    )


REFUSALS: Final = Refusals(
    "the robot's recorder",
    {
        **OF_ANY_SERVICE,
        grpc.StatusCode.FAILED_PRECONDITION: (PreconditionError, Reason.RECORDER_NOT_READY),
        grpc.StatusCode.ABORTED: (ConflictError, Reason.RECORDING_CHANGED),
        grpc.StatusCode.RESOURCE_EXHAUSTED: (TooMuchError, Reason.DISK_FULL),
        grpc.StatusCode.DATA_LOSS: (lambda text, _: DamagedError(text), Reason.RECORDING_DAMAGED),
    },
    unreachable,
)
