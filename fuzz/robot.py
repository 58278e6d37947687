"""Messages of the robot, from the bytes on its bus to the bytes that an operator gets."""

import importlib
from typing import Any, Final

from rclpy.serialization import deserialize_message

from gateway.config import DEFAULT_SOURCES, SourceSettings
from gateway.ros.list_truncation import truncate_list
from gateway.ros.readers import reader_for
from gateway.ros.source import max_list_items
from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.mapping.status import overlay_snapshot
from gateway.status.board import Board
from gateway.status.preview import Counters, PreviewState, PreviewView
from gateway.status.snapshot import Identity, Programs, Rules, Setup, SourceRule, take
from gateway.status.values import Received

MODE: Final = SourceSettings(kind="mode", topic="/mode", type="std_msgs/msg/String", stale_after_ms=1000)
OTHER_DETECTIONS: Final = SourceSettings(
    kind="detections", topic="/d", type="vision_msgs/msg/Detection2DArray", stale_after_ms=500
)
GENERIC: Final = (
    SourceSettings(kind="text", label="name", topic="/n", type="std_msgs/msg/String", field="data"),
    SourceSettings(
        kind="number", label="cell", topic="/b", type="sensor_msgs/msg/BatteryState", field="cell_voltage[1]"
    ),
    SourceSettings(
        kind="number",
        label="level",
        topic="/l",
        type="diagnostic_msgs/msg/DiagnosticArray",
        field="status[1].level",
    ),
)
SOURCES: Final = (*DEFAULT_SOURCES, MODE, OTHER_DETECTIONS, *GENERIC)
"""One of each type that has a reader, and of the generic kinds."""
_RULES: Final = Rules(
    {source.spec: SourceRule(source.stale_after_ms, source.required) for source in SOURCES}, 3000
)
_PREVIEW: Final = PreviewView(PreviewState.DISABLED, None, "", False, None, None, None, None, Counters())


def type_of(source: SourceSettings) -> Any:
    """The message's Python class."""
    package, _, name = source.type.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


_TYPES: Final = [type_of(source) for source in SOURCES]


def robots_message(data: bytes) -> None:
    """The first byte chooses the source, the rest is the message as it came over the bus."""
    if not data:
        return
    index = data[0] % len(SOURCES)
    source, raw = SOURCES[index], data[1:]
    max_items = max_list_items(source)
    if max_items:
        raw, _ = truncate_list(raw, max_items)
    try:
        message = deserialize_message(raw, _TYPES[index])
    except Exception:  # noqa: BLE001  # the foreign decoder's word on foreign bytes; the sampler counts it
        return
    value = reader_for(source)(message, source)
    if value is not None:
        _serve(source, value)


def _serve(source: SourceSettings, value: Any) -> None:
    board = Board()
    board[source.spec] = Received(value, 1.0)
    board[source.spec] = Received(value, 1.5)
    now = take(Setup(Identity("fuzz", "0", insecure=False), _RULES), board, Programs(_PREVIEW), now_s=2.0)
    answer = overlay_snapshot(now, Recipient("127.0.0.1", sees_passphrase=True)).SerializeToString()
    assert len(answer) < 1_000_000
