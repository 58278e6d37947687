"""What a gateway says of its preview, as a test wants it."""

from dataclasses import replace
from typing import Any

from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.client.results import (
    PreviewState,
    PreviewStatus,
    StreamContainer,
    StreamEndpoint,
    StreamTransport,
    VideoCodec,
)

NOTHING_KNOWN = GET_SYSTEM_STATUS.decode(b"").preview
ENDPOINT = StreamEndpoint(
    transport=StreamTransport.SRT,
    host="127.0.0.1",
    port=7100,
    uri="srt://127.0.0.1:7100",
    latency_ms=20,
    codec=VideoCodec.H264,
    container=StreamContainer.MPEG_TS,
    encrypted=False,
    passphrase="",
)


def preview(state: PreviewState, *, last_error: str = "", **endpoint: Any) -> PreviewStatus:
    """In this state, with a stream; keywords change its address."""
    return replace(NOTHING_KNOWN, state=state, last_error=last_error, endpoint=replace(ENDPOINT, **endpoint))
