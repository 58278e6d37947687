"""What robots, receivers and consoles of a fleet read of each other by way of the hub."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Any, Final

from google.protobuf.message import DecodeError

from bridge.connection.robot_state import Own, robot_state, same_but_for_time
from bridge.uploads.route import index_of
from console.fleet.columns import COLUMNS
from console.fleet.details import detail_rows
from console.fleet.model import ReportedState, fleet_rows
from console.fleet.values import Enrolment, RobotState
from console.fleet.wire import answer_of, items_of, recording_of, state_of
from fleet.reading import LARGEST_STATE
from fleet.receipt_keys import ReceiptSigner
from gateway.config import SourceSettings
from gateway.ros.field_types import FieldMissingError, check_field
from gateway.ros.readers.field_path import steps_of, value_at
from hub.exporter.collector import FleetCollector
from hub.receiver.service import ReceiverService
from hub.receiver.store import Store, StoredObject, StoredPart, StoreError, StoreProblem
from hub.receiver.verified import Party
from omniseer.fleet.v1 import upload_pb2
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from tests.support.control_characters import CONTROL_CHARACTERS

ROBOT: Final = "lab2"
REQUESTS: Final = (
    "begin_upload",
    "begin_file",
    "get_parts",
    "complete_file",
    "verify_file",
    "complete_upload",
    "get_files",
)
_NOW_MS: Final = 2_000_000_000_000
_OBEYED: Final = frozenset(CONTROL_CHARACTERS)
_LONGEST_CELL: Final = 200
_LONGEST_ANSWER: Final = 1024 * 1024
_OWN: Final = Own(
    robot=ROBOT,
    bridge_version="1",
    gateway_target="",
    gateway_reachable=True,
    outbox_events=0,
    events_dropped=0,
)
_MESSAGE_TYPES: Final = (
    ("sensor_msgs/msg/BatteryState", "sensor_msgs.msg", "BatteryState"),
    ("diagnostic_msgs/msg/DiagnosticArray", "diagnostic_msgs.msg", "DiagnosticArray"),
    ("nav_msgs/msg/Odometry", "nav_msgs.msg", "Odometry"),
)


def hubs_content(data: bytes) -> None:
    """What robots have put into the hub, in console and exporter: bounded cells of text, a valid page."""
    state = state_of(ROBOT, data)
    enrolled = {ROBOT: Enrolment(ROBOT)}
    (row,) = fleet_rows(enrolled, {ROBOT: ReportedState(state, _NOW_MS)}, _NOW_MS)
    shown = [column.cell(row).text for column in COLUMNS]
    if isinstance(state, RobotState):
        shown += [text for each in detail_rows(row) for text in (each.label, each.mark, each.text)]
    assert all(len(text) <= _LONGEST_CELL and not _OBEYED & set(text) for text in shown)
    collector = FleetCollector(lambda: _NOW_MS, lambda: True)
    collector.take_robot(ROBOT, b"{}", deleted=False)
    collector.take_state(ROBOT, data, _NOW_MS, deleted=False)
    series = [line.rsplit(" ", 1)[0] for line in collector.text().decode().split("\n") if line[:1] != "#"]
    assert len(series) == len(set(series))
    for item in items_of(f"fleet.{ROBOT}.ev.g1.3", data, _NOW_MS):
        assert item.robot == ROBOT
    recording_of(f"{ROBOT}.r1", data)
    answer_of(f"fleet.{ROBOT}.res.c1", data)


def gateways_status(data: bytes) -> None:
    """A status of the gateway, in the bridge: what is sent fits, and is the same while nothing changes."""
    status = SystemStatus()
    with suppress(DecodeError):
        status.ParseFromString(data)
        state = robot_state(_OWN, status)
        assert state.ByteSize() <= LARGEST_STATE
        assert same_but_for_time(state) == same_but_for_time(robot_state(_OWN, status))
        assert isinstance(state_of(ROBOT, state.SerializeToString()), RobotState)


def receivers_request(data: bytes) -> None:
    """A robot's or a person's request: answers that fit, and no object outside the robot's own place.

    The first byte chooses the request.
    """
    name = REQUESTS[data[0] % len(REQUESTS)] if data else ""
    store = _Store()
    signer = ReceiptSigner(bytes(32))
    service = ReceiverService(
        Party("lab", signer, (signer.public_key,)),
        store,
        _Records(),
        _Inline(),
    )
    answers: list[upload_pb2.UploadResponse] = []

    async def send(response: upload_pb2.UploadResponse) -> None:
        answers.append(response)

    work = service.answer(ROBOT, name, data[1:], send, of_people=name == "get_files")
    asyncio.run(work)
    assert answers
    assert all(each.ByteSize() <= _LONGEST_ANSWER for each in answers)
    assert answers[-1].error.message.isprintable()
    for key in store.keys:
        assert key.startswith(f"lab/{ROBOT}/")
        assert not {"", ".", ".."} & set(key.split("/"))


def kernels_answer(data: bytes) -> None:
    """The kernel's answer to a request for a route, in the bridge."""
    found = index_of(data)
    assert found is None or 0 < found < 1 << 31


def field_path(data: bytes) -> None:
    """A field's path in the configuration: refused, or found in the type and in its messages.

    The first byte chooses the message type.
    """
    import importlib  # noqa: PLC0415

    name, module, kind = _MESSAGE_TYPES[data[0] % len(_MESSAGE_TYPES) if data else 0]
    message_type = getattr(importlib.import_module(module), kind)
    try:
        source = SourceSettings(
            kind="number", label="x", topic="/x", type=name, field=data[1:].decode("utf-8", "replace")
        )
        check_field(message_type, source)
    except (ValueError, FieldMissingError):
        return
    finally:
        steps_of.cache_clear()
    value = value_at(message_type(), source.field or "")
    assert value is None or isinstance(value, bool | int | float | bytes)


class _Inline(ThreadPoolExecutor):
    """Does the work of threads at once."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            done.set_result(fn(*args, **kwargs))
        except StoreError as error:
            done.set_exception(error)
        return done


class _Records:
    async def put(self, _bucket: str, key: str, _value: bytes) -> None:
        """Takes a key."""
        assert key.startswith(f"{ROBOT}.")


class _Store(Store):
    """A store with one object under every key; notes the keys."""

    def __init__(self) -> None:
        self.keys: list[str] = []

    def location(self, key: str) -> str:
        return f"s3://b/{key}"

    def find(self, key: str) -> StoredObject | None:
        self.keys.append(key)
        return StoredObject(3, "e") if key.endswith("a") else None

    def read(self, key: str, most: int) -> bytes | None:
        self.keys.append(key)
        return None if "recei" in key else b"abc"[:most]

    def stream(self, key: str, etag: str) -> Iterator[bytes]:
        assert etag
        self.keys.append(key)
        yield b"abc"

    def write(self, key: str, content: bytes) -> None:
        assert len(content) <= _LONGEST_ANSWER
        self.keys.append(key)

    def create(self, key: str) -> None:
        self.keys.append(key)

    def delete(self, key: str, etag: str) -> None:
        assert etag
        self.keys.append(key)

    def sizes(self, prefix: str, most: int) -> dict[str, int]:
        assert most > 0
        key = f"{prefix}data.mcap"
        self.keys.append(key)
        return {key: 3}

    def open_upload(self, key: str) -> str:
        self.keys.append(key)
        return "u1"

    def parts(self, key: str, upload_id: str) -> list[StoredPart]:
        assert upload_id
        self.keys.append(key)
        return [StoredPart(1, "e", 3)]

    def part_url(self, key: str, upload_id: str, number: int, size: int) -> str:
        self.keys.append(key)
        assert upload_id
        assert number > 0
        assert size > 0
        return "https://store/part"

    def file_url(self, key: str) -> str:
        self.keys.append(key)
        return "https://store/file"

    def complete(self, key: str, upload_id: str, parts: Sequence[tuple[int, str]]) -> None:
        self.keys.append(key)
        raise StoreError(StoreProblem.MISSING, f"the store has no upload {upload_id!r} of {len(parts)} parts")
