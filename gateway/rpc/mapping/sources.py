"""The sources as the contract tells them."""

from gateway.rpc.mapping.enums import SOURCE_STATES
from gateway.status.sources import SourceView
from omniseer.gateway.v1 import source_pb2 as pb


def source_status(source: SourceView) -> pb.SourceStatus:
    """One source."""
    return pb.SourceStatus(
        name=source.name,
        state=SOURCE_STATES[source.state],
        available=source.freshness.available,
        stale=source.freshness.stale,
        age_ms=source.freshness.age_ms,
        required=source.required,
        detail=source.detail,
    )
