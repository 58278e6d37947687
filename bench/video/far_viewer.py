"""A viewer as a program: writes what it saw as JSON, `[captured_s, decoded_s, corrupt]` for each frame."""

import argparse
import json
import time

from bench.video.viewing import watch
from bench.video.window import Glance
from common.backoff import Backoff
from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError
from tests.support.receiver import NoFrameError, Receiver


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("host")
    parser.add_argument("port", type=int)
    parser.add_argument("latency_ms", type=int)
    parser.add_argument("seconds", type=float)
    given = parser.parse_args()
    seen = _watch(StreamAddress(given.host, given.port, given.latency_ms), given.seconds)
    print(json.dumps([(one.captured_s, one.decoded_s, one.corrupt) for one in seen]))


def _watch(address: StreamAddress, seconds: float) -> list[Glance]:
    """Watches as long as asked and connects again when it must; a link without any frame is a result, too."""
    until_s, backoff = time.monotonic() + seconds, Backoff(first_s=0.1, longest_s=2.0)
    seen: list[Glance] = []
    while time.monotonic() < until_s:
        try:
            with Receiver(address, queue_size=8) as receiver:
                while (left_s := until_s - time.monotonic()) > 0:
                    try:
                        seen += watch(receiver, min(1.0, left_s))
                        backoff.reset()
                    except NoFrameError:
                        continue
        except StreamError as error:
            if error.final:
                raise
            time.sleep(min(backoff.next_s(), max(0.0, until_s - time.monotonic())))
    return seen


if __name__ == "__main__":
    main()
