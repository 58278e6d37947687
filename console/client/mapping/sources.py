"""The sources, from the contract's messages."""

from console.client.mapping import enums
from console.client.mapping.known import when
from console.client.results import Source
from omniseer.gateway.v1 import source_pb2 as wire


def source(message: wire.SourceStatus) -> Source:
    """One source."""
    return Source(
        available=message.available,
        stale=message.stale,
        age_ms=when(message.available, message.age_ms),
        name=message.name,
        state=enums.source_state(message.state),
        required=message.required,
        detail=message.detail,
    )
