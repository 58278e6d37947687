"""Connects to a stream by the delivery that is asked for, or possible."""

from common.errors import UserError
from console.receiver.address import StreamAddress
from console.receiver.delivery import DeliveryChoice
from console.receiver.direct import DirectConnection
from console.receiver.errors import no_socket
from console.receiver.frame_queue import FrameQueue
from console.receiver.libsrt import DirectImpossibleError, LocalSocketError
from console.receiver.options import ReceiverOptions
from console.receiver.srt import SrtConnection


def connect(
    address: StreamAddress, queue: FrameQueue, options: ReceiverOptions
) -> DirectConnection | SrtConnection:
    """Connects to the robot, fills a frame queue, and ends the queue with the reason of a failure.

    Args:
        address: SRT listener to connect to.
        queue: takes the frames and the end of the stream.
        options: of the receiver.

    Raises:
        StreamError: too many files are open.
        UserError: a GStreamer element is not installed, or direct delivery is required and not possible.
    """
    if options.delivery is DeliveryChoice.SRT:
        return SrtConnection(address, queue, options)
    try:
        return DirectConnection(address, queue, options)
    except DirectImpossibleError as error:
        if isinstance(error, LocalSocketError) and error.exhausted:
            # GStreamer's source needs more descriptors than direct delivery.
            raise no_socket(address, str(error), error.remedy) from error
        if options.delivery is DeliveryChoice.DIRECT:
            raise UserError(
                f"direct delivery is not possible: {error}", f"{error.remedy}, or choose delivery `auto`"
            ) from error
        return SrtConnection(address, queue, options, error)
