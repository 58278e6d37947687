"""Records topics as an ordinary rclpy node does: `python -m bench.rec.callbacks FILE TOPIC:TYPE...`.

Callbacks on a SingleThreadedExecutor get each message as an object, and write it into an MCAP file by the
library's own writer: the same messages, in chunks of the same size and compression as the recorder's. Without
what the recorder does besides: no digest, nothing synced, no segments. Prints "ready" when all topics have
come; writes until its standard input closes, and prints how many messages it has written.
"""

import sys
import threading
import time
from functools import partial
from pathlib import Path
from typing import IO, Any

from mcap.writer import CompressionType, Writer
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

from common.ros_node import message_class
from common.ros_transport import chosen_transport
from recorder.intake.schemas import ENCODING, Schemas
from recorder.mcap.records import CDR, PROFILE
from recorder.mcap.writer import MAX_CHUNK

_DEPTH = 1000


class Recording:
    """Writes what callbacks get.

    Attributes:
        counts: messages written, by topic.
    """

    def __init__(self, file: IO[Any]) -> None:
        self._writer = Writer(file, chunk_size=MAX_CHUNK, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE)
        self._schemas = Schemas()
        self.counts: dict[str, int] = {}

    def subscribe(self, node: Any, topic: str, type_name: str) -> None:
        """Records a topic from now on."""
        schema = self._writer.register_schema(type_name, ENCODING, self._schemas.of(type_name))
        channel = self._writer.register_channel(topic, CDR, schema)
        self.counts[topic] = 0
        callback = partial(self._write, topic, channel)
        node.create_subscription(message_class(type_name), topic, callback, QoSProfile(depth=_DEPTH))

    def finish(self) -> None:
        """Completes the file."""
        self._writer.finish()

    def _write(self, topic: str, channel: int, message: Any) -> None:
        now_ns = time.time_ns()
        self._writer.add_message(channel, now_ns, serialize_message(message), now_ns)
        self.counts[topic] += 1


def main(path: Path, topics: list[str]) -> None:
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node("bench_callbacks", context=context, enable_rosout=False, start_parameter_services=False)
    executor = SingleThreadedExecutor(context=context)
    with path.open("wb") as file:
        recording = Recording(file)
        for each in topics:
            recording.subscribe(node, *each.split(":"))
        executor.add_node(node)
        thread = threading.Thread(target=_spin, args=(executor,))
        thread.start()
        while not all(recording.counts.values()):
            time.sleep(0.05)
        print("ready", flush=True)
        for _ in sys.stdin:
            print(sum(recording.counts.values()), flush=True)
        executor.shutdown()
        thread.join()
        recording.finish()
    node.destroy_node()
    context.shutdown()


def _spin(executor: Any) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


if __name__ == "__main__":
    with chosen_transport():
        main(Path(sys.argv[1]), sys.argv[2:])
