"""States, events and recordings as robots put them into the hub: whole, and wrong in every way."""

from collections.abc import Iterator

from omniseer.fleet.v1.event_pb2 import DroppedEvents, EventBatch, EventItem
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.gateway.v1 import event_pb2, fault_pb2, states_pb2


def healthy_state(robot: str) -> RobotState:
    """A robot that is up and has nothing to report."""
    return RobotState(
        robot=robot,
        bridge_run_id="b1",
        sequence=1,
        gateway_reachable=True,
        gateway_name=robot,
        gateway_run_id="g1",
        gateway_uptime_s=7260,
        ready=True,
        health=states_pb2.ROBOT_HEALTH_OK,
        summary="robot healthy",
        mode="idle",
        battery_percent=78,
        disk_used_percent=40,
    )


def event(
    sequence: int,
    *,
    run_id: str = "g1",
    message: str = "",
    severity: "fault_pb2.FaultSeverity.ValueType" = fault_pb2.FAULT_SEVERITY_INFO,
) -> event_pb2.Event:
    """An event of a fault."""
    found = event_pb2.Event(
        run_id=run_id,
        sequence=sequence,
        severity=severity,
        component="lidar",
        message=message or f"event {sequence}",
        wall_clock_unix_ms=1_790_000_000_000 + sequence,
    )
    found.fault_raised.fault.id = "lidar.stale"
    return found


def batch(robot: str, *items: event_pb2.Event | DroppedEvents, run_id: str = "g1") -> EventBatch:
    """A batch of events and gaps."""
    made = EventBatch(robot=robot, run_id=run_id)
    for item in items:
        if isinstance(item, DroppedEvents):
            made.items.append(EventItem(dropped=item))
        else:
            made.items.append(EventItem(event=item))
    first, last = made.items[0], made.items[-1]
    made.first_sequence = first.event.sequence or first.dropped.first_sequence
    made.last_sequence = last.event.sequence or last.dropped.last_sequence
    return made


def subject_of(made: EventBatch) -> str:
    """The subject of a batch."""
    return f"fleet.{made.robot}.ev.{made.run_id}.{made.first_sequence}"


def wrong_bytes() -> Iterator[bytes]:
    """Bytes that are no message, or one that claims more than it has."""
    yield b"\xff" * 40
    yield b"\x0a\xff\xff\xff\xff\x0f"
    yield b"not a message at all \x1b]0;owned\x07"
