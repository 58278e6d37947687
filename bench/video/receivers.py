"""Receivers that do not decode: `python -m bench.video.receivers PORT LATENCY_MS COUNT`.

They connect to an SRT listener on this machine one after the other; "ready" is printed once all of them
receive. They stay until standard input closes; then the bytes that each has received are printed as JSON.
"""

import json
import sys
import threading
from typing import Any, Final

from common.gst import Gst, stop

_ATTEMPTS: Final = 20
_DATA_WITHIN_S: Final = 4.0
"""Longer than SRT's own connection timeout (SRTO_CONNTIMEO, 3 s)."""


def main() -> None:
    port, latency_ms, count = (int(word) for word in sys.argv[1:])
    pipelines = [_receiving(port, latency_ms) for _ in range(count)]
    print("ready", flush=True)
    sys.stdin.read()
    print(json.dumps([_received_bytes(pipeline) for pipeline in pipelines]), flush=True)
    for pipeline in pipelines:
        stop(pipeline)


def _receiving(port: int, latency_ms: int) -> Any:
    """Returns a pipeline that receives.

    Raises:
        RuntimeError: none did, in many attempts.
    """
    description = (
        f"srtsrc uri=srt://127.0.0.1:{port}?mode=caller latency={latency_ms} auto-reconnect=false"
        " name=in ! fakesink name=out sync=false signal-handoffs=true"
    )
    for _ in range(_ATTEMPTS):
        pipeline = Gst.parse_launch(description)
        out, arrived = pipeline.get_by_name("out"), threading.Event()
        handler = out.connect("handoff", lambda *_: arrived.set())  # noqa: B023
        pipeline.set_state(Gst.State.PLAYING)
        received = arrived.wait(_DATA_WITHIN_S)
        # A signal for each packet would be Python per packet.
        out.disconnect(handler)
        out.set_property("signal-handoffs", False)
        if received:
            return pipeline
        stop(pipeline)
    raise RuntimeError(f"no data from UDP port {port}")


def _received_bytes(pipeline: Any) -> int:
    stats = pipeline.get_by_name("in").get_property("stats")
    return int(stats.get_value("bytes-received") or 0)


if __name__ == "__main__":
    main()
