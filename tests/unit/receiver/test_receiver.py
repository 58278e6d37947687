"""The receiver with connections that the test plays."""

import pytest

from console.receiver.address import StreamAddress
from console.receiver.errors import StreamEndedError, ended
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions
from console.receiver.receiver import Receiver
from tests.unit.receiver.frames import frame

ADDRESS = StreamAddress("robot")


class Script:
    """Plays what a connection puts into the queue when it is made: f for a frame, e for the end."""

    def __init__(self, steps: str) -> None:
        self._steps = steps
        self.open = 0

    def connect(self, address: StreamAddress, queue: FrameQueue, _options: ReceiverOptions) -> "Script":
        self.open += 1
        for step in self._steps:
            if step == "f":
                queue.put(frame())
            else:
                queue.end(ended(address, "lost"))
        return self

    def close(self) -> None:
        self.open -= 1


def test_the_end_is_raised_after_the_last_frame() -> None:
    script = Script("ffe")
    with Receiver(ADDRESS, connect=script.connect) as receiver:
        receiver.next_frame(1)
        receiver.next_frame(1)
        for _ in range(2):
            with pytest.raises(StreamEndedError, match="lost"):
                receiver.next_frame(1)
    assert script.open == 0
