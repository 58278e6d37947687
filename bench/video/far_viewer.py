"""A viewer as a program: writes what it saw as JSON, `[captured_s, decoded_s, corrupt]` for each picture."""

import argparse
import json
import time

from bench.video.viewing import Glance, watch
from console.receiver.address import StreamAddress
from console.receiver.errors import NoPictureError
from console.receiver.receiver import Receiver, Reconnect


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("host")
    parser.add_argument("port", type=int)
    parser.add_argument("latency_ms", type=int)
    parser.add_argument("seconds", type=float)
    given = parser.parse_args()
    address = StreamAddress(given.host, given.port, given.latency_ms)
    with Receiver(address, queue_size=8, reconnect=Reconnect()) as receiver:
        seen = _watch(receiver, given.seconds)
    print(json.dumps([(one.captured_s, one.decoded_s, one.corrupt) for one in seen]))


def _watch(receiver: Receiver, seconds: float) -> list[Glance]:
    """As long as asked; a link that lets nothing through is a result, too."""
    until_s = time.monotonic() + seconds
    seen: list[Glance] = []
    while (left_s := until_s - time.monotonic()) > 0:
        try:
            seen += watch(receiver, min(1.0, left_s))
        except NoPictureError:
            continue
    return seen


if __name__ == "__main__":
    main()
