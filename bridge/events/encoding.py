"""Batches and gaps in the fleet's schema."""

from typing import Final

from google.protobuf.message import DecodeError

from bridge.events.values import Batch, Event, Gap, Item
from omniseer.fleet.v1 import event_pb2 as pb
from omniseer.gateway.v1 import event_pb2, fault_pb2


def is_whole(event: Event) -> bool:
    """Returns whether an event's payload is still that of this event: a bad disk may have changed it."""
    try:
        message = event_pb2.Event.FromString(event.payload)
    except DecodeError:
        return False
    return (message.run_id, message.sequence) == (event.run_id, event.sequence)


def batch_message(robot: str, batch: Batch) -> bytes:
    """Returns an EventBatch, of events that are whole. The same batch always has the same bytes."""
    message = pb.EventBatch(
        robot=robot,
        run_id=batch.run_id,
        first_sequence=batch.first,
        last_sequence=batch.last,
        items=[_item(each) for each in batch.items],
    )
    return message.SerializeToString(deterministic=True)


def _item(item: Item) -> pb.EventItem:
    if isinstance(item, Event):
        return pb.EventItem(event=event_pb2.Event.FromString(item.payload))
    return pb.EventItem(dropped=_dropped(item))


def _dropped(gap: Gap) -> pb.DroppedEvents:
    known = gap.worst in _SEVERITIES
    return pb.DroppedEvents(
        reason=pb.DropReason.Name(int(gap.reason)),  # type: ignore[arg-type]  # a name is as good
        first_sequence=gap.first,
        last_sequence=gap.last,
        worst_severity=fault_pb2.FaultSeverity.Name(gap.worst) if known else None,  # type: ignore[arg-type]
        earlier_run_incomplete=gap.earlier,
    )


_SEVERITIES: Final = frozenset(fault_pb2.FaultSeverity.values())
