"""Takes down what an SRT listener sends, byte for byte, as it comes."""

import time

from common.gst import Gst


def record(port: int, seconds: float, *, latency_ms: int = 20, passphrase: str = "") -> bytes:
    """The transport stream from joining on.

    Args:
        port: of the listener at 127.0.0.1.
        seconds: how long from the first byte.
        latency_ms: SRT latency.
        passphrase: empty for none.
    """
    pipeline = Gst.parse_launch(
        f"srtsrc name=in uri=srt://127.0.0.1:{port}?mode=caller latency={latency_ms}"
        " ! appsink name=out sync=false"
    )
    if passphrase:
        pipeline.get_by_name("in").set_property("passphrase", passphrase)
    out = pipeline.get_by_name("out")
    pieces: list[bytes] = []
    until_s: float | None = None
    try:
        pipeline.set_state(Gst.State.PLAYING)
        while until_s is None or time.monotonic() < until_s:
            sample = out.emit("try-pull-sample", 10 * Gst.SECOND)
            assert sample, "nothing comes"
            until_s = until_s or time.monotonic() + seconds
            buffer = sample.get_buffer()
            pieces.append(buffer.extract_dup(0, buffer.get_size()))
    finally:
        pipeline.set_state(Gst.State.NULL)
    return b"".join(pieces)
