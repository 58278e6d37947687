"""Everything that reads bytes from outside. A target takes bytes and returns; whatever it raises is a defect.

What may come of bad input (a decoder's own error, one line for people) is caught here, and nothing else.
"""

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import MappingProxyType, SimpleNamespace
from typing import Any, Final

from google.protobuf.message import DecodeError, Message

from bridge.commands.judgement import LONGEST_EXPIRY_S, Snapshot, Stray, judge
from bridge.commands.judgement import Request as Handed
from bridge.events.values import DropReason, Position
from bridge.robot.feed import Feed, FeedError
from common import camera_tap
from common.ca import certificate_info
from common.config import load
from common.errors import DomainError, InvalidRequestError, UserError
from common.metrics_endpoint import respond
from common.printable import escaped, printable, printable_lines
from common.request_id import begin, current
from common.trial import TrialError, parse_result
from console.capture_time import WRAP_TICKS, ns_to_ticks
from console.client.mapping.methods import METHODS
from console.receiver.age import AgeBound
from console.receiver.decoder_time import DecoderTime
from console.receiver.reorder import Reorder
from console.receiver.transport_stream import PACKET_BYTES, TransportStream, UnknownVideoError
from console.robots.login import parse_login
from console.robots.robots_file import parse_robots_file
from fuzz.admission import admission
from fuzz.fleet import field_path, gateways_status, hubs_content, kernels_answer, receivers_request
from fuzz.network import announcement, gateways_refusal
from fuzz.programs import bridges_report, drives_report, gateways_packets, recorders_report
from fuzz.recording import export_request, segment, video_tap
from fuzz.robot import robots_message
from gateway.access.audit import line_of
from gateway.access.store import parse_store
from gateway.access.token import parse_token
from gateway.config import GatewaySettings, load_settings
from gateway.links.preview.wire import from_wire
from gateway.links.watch import LinkLostError
from gateway.ros.list_truncation import truncate_list
from gateway.rpc.calls.methods import SERVICES, Method
from gateway.rpc.interceptors.validation import Validation
from gateway.status.event import ControlAction, ControlResult
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsResponse
from omniseer.preview.v1 import preview_service_pb2 as preview_pb
from preview.config import PreviewSettings
from preview.rpc.mapping import desired_state
from tap.image import read_compressed, read_image
from tap.refusal import RefusedError
from tests.support.control_characters import CONTROL_CHARACTERS

Target = Callable[[bytes], None]

_VALIDATION: Final = Validation(GatewaySettings().limits.request_bytes)
_OBEYED: Final = frozenset(CONTROL_CHARACTERS)
_METHODS: Final = [Method(f"/{each.full_name}/{name}") for each in SERVICES for name in each.methods_by_name]


def operators_request(data: bytes) -> None:
    """The request of every method, parsed and checked against the schema's rules."""
    for method in _METHODS:
        call: Any = SimpleNamespace(method=method, request=None)
        with suppress(DomainError):
            _VALIDATION.on_request(call, data)


def camera_taps_packet(data: bytes) -> None:
    """Packets of the camera tap, as the preview takes them in, and requests, as the tap does."""
    with suppress(camera_tap.MalformedPacketError):
        header, content = camera_tap.decode(data)
        assert header.kind is not camera_tap.Kind.FRAME or 0 < header.size <= camera_tap.MAX_FRAME_BYTES
        _must_be_one_line(camera_tap.decode_text(content))
    with suppress(camera_tap.MalformedPacketError):
        asked, topic = camera_tap.decode_request(data)
        assert camera_tap.is_topic(topic) is (asked is not camera_tap.Asked.STATE)


def image_message(data: bytes) -> None:
    """A message of an image topic, as the camera tap reads it: refused, or all of its pixels are there."""
    read = read_compressed if data[:1] >= b"\x80" else read_image
    with suppress(RefusedError):
        frame = read(data[1:])
        assert 0 < frame.size <= camera_tap.MAX_FRAME_BYTES
        assert sum(map(len, frame.pieces)) == frame.size


def gateways_request(data: bytes) -> None:
    """ApplyDesiredState, as the preview service takes it in."""
    request = preview_pb.ApplyDesiredStateRequest()
    if _parses(request, data):
        with suppress(InvalidRequestError):
            desired_state(request.desired)


def previews_report(data: bytes) -> None:
    """What the preview service reports, as the gateway takes it in."""
    state = preview_pb.ActualState()
    if _parses(state, data):
        with suppress(LinkLostError):
            from_wire(state)


def robots_answer(data: bytes) -> None:
    """Every answer of the contract, as the client library takes it in."""
    for method in METHODS:
        with suppress(DecodeError):
            method.decode(data)


def configuration(data: bytes) -> None:
    """The configuration files of both programs. An error is one line."""
    with NamedTemporaryFile(suffix=".yaml") as file:
        file.write(data)
        file.flush()
        for load_file in (load_settings, _load_previews_settings):
            try:
                load_file(Path(file.name))
            except UserError as error:
                _must_be_one_line(str(error))


def metrics_request(data: bytes) -> None:
    """An HTTP request to the metrics' port: always a whole answer."""
    assert respond(data, lambda: b"x 1\n").startswith(b"HTTP/1.1 ")


def request_id(data: bytes) -> None:
    """A caller's own request id: nothing comes through that could fake a line of a log."""
    begin(_Call(data.decode("utf-8", "replace")))
    assert 0 < len(current()) <= 64
    assert current().isascii()
    assert current().isprintable()


def token(data: bytes) -> None:
    """What a caller shows as a token: one of ours, whole, or none."""
    text = data.decode("utf-8", "replace")
    found = parse_token(text)
    assert found is None or text.isascii()


def credential_list(data: bytes) -> None:
    """The gateway's list of credentials. An error quotes nothing of it."""
    with suppress(ValueError):
        parse_store(data.decode("utf-8", "replace"))


def login(data: bytes) -> None:
    """What an operator pastes into robotctl login. An error is one line."""
    try:
        parse_login(data.decode("utf-8", "replace"))
    except UserError as error:
        _must_be_one_line(str(error))


def known_robots(data: bytes) -> None:
    """The file of known robots. An error is one line."""
    try:
        parse_robots_file(Path("config.toml"), data.decode("utf-8", "replace"))
    except UserError as error:
        _must_be_one_line(str(error))


def long_list(data: bytes) -> None:
    """A list that is truncated before decoding: the message keeps its length, nothing is added."""
    shorter, truncated = truncate_list(data, max_items=100)
    assert len(shorter) == len(data)
    assert truncated >= 0


def certificate(data: bytes) -> None:
    """A certificate file."""
    with suppress(ValueError):
        certificate_info(data)


def trial_result(data: bytes) -> None:
    """What a child has printed before it ended, well or by a signal."""
    for code in (0, 1, -1 - (data[0] % 64 if data else 0)):
        with suppress(TrialError):
            assert isinstance(parse_result(data, code), dict)


def terminal_text(data: bytes) -> None:
    """A robot's text: nothing that a terminal obeys is left of it, and JSON keeps its meaning."""
    text = data.decode("utf-8", "surrogateescape")
    shown = printable(text)
    assert len(shown) == len(text)
    assert not _OBEYED & set(shown)
    assert not _OBEYED & set(printable_lines(text)) - {"\n"}
    document = escaped(json.dumps({"text": text}, ensure_ascii=False))
    assert json.loads(document) == {"text": text}
    assert not _OBEYED & set(document)


def audit_line(data: bytes) -> None:
    """A control action of a caller that sends anything: one line, which reads back."""
    text = data.decode("utf-8", "replace")
    action = ControlAction(text, text, "SetPreviewMode", text, ControlResult.REFUSED, text, request_id=text)
    line = line_of(action)
    assert line.isascii()
    assert line.splitlines() == [line.rstrip("\n")]
    assert json.loads(line)["request"] == text


def video_stream(data: bytes) -> None:
    """Packets in any order and of any content: what is delivered is in order, and looks like access units.

    Their times are some that GStreamer can hold, and lead back to the time stamp.

    Each packet is a byte of its number and up to 188 bytes of its content.
    """
    reorder, stream, delivered = Reorder(0, wait_s=0.25, capacity=64), TransportStream(), 0
    times, age = DecoderTime(), AgeBound(0.6)
    with suppress(UnknownVideoError):
        for index, start in enumerate(range(0, len(data), 1 + PACKET_BYTES)):
            packet = data[start : start + 1 + PACKET_BYTES]
            now_s = index * 0.05
            for each in reorder.put(packet[0], packet[1:], now_s) + reorder.expire(now_s):
                delivered += 1 + each.missing
                if each.missing:
                    stream.skip(each.missing)
                for unit in stream.feed(each.payload):
                    assert unit.data
                    if unit.pts_ticks is not None:
                        assert 0 <= unit.pts_ticks < WRAP_TICKS
                        time_ns = times.time_ns(unit.pts_ticks)
                        assert 0 <= time_ns < 1 << 63
                        assert ns_to_ticks(time_ns) % WRAP_TICKS == unit.pts_ticks
                        age.exceeded(now_s, time_ns / 1e9, None)
    assert delivered <= 256
    assert reorder.held <= 64


def hubs_command(data: bytes) -> None:
    """A message of the stream of commands: what is handed over is allowed, and in time."""
    judgement = judge("fleet.lab2.cmd.c1", data, robot="lab2", allowed=("snapshot",), age_s=5.0)
    assert not isinstance(judgement, Stray)
    if isinstance(judgement, Handed):
        assert isinstance(judgement.action, Snapshot)
        assert 0 < judgement.remaining_s <= LONGEST_EXPIRY_S - 5
        assert not _OBEYED & set(judgement.issued_by + judgement.action.label)


def gateways_event(data: bytes) -> None:
    """What the bridge takes from the gateway's stream of events: no hole, none twice."""
    response = SubscribeEventsResponse()
    if not _parses(response, data):
        return
    feed = Feed(Position("a", 3))
    with suppress(FeedError):
        items = feed.take(response, DropReason.NO_LONGER_KEPT)
        assert all(each.last >= each.first - 1 for each in items)
        assert not items or feed.position == Position(items[-1].run_id, items[-1].last)


TARGETS: Final[Mapping[str, Target]] = MappingProxyType(
    {
        target.__name__: target
        for target in (
            operators_request,
            gateways_request,
            previews_report,
            robots_answer,
            configuration,
            metrics_request,
            request_id,
            token,
            credential_list,
            login,
            known_robots,
            long_list,
            robots_message,
            certificate,
            trial_result,
            terminal_text,
            audit_line,
            admission,
            video_stream,
            video_tap,
            camera_taps_packet,
            image_message,
            segment,
            export_request,
            hubs_command,
            gateways_event,
            gateways_packets,
            drives_report,
            recorders_report,
            bridges_report,
            hubs_content,
            gateways_status,
            receivers_request,
            kernels_answer,
            field_path,
            gateways_refusal,
            announcement,
        )
    }
)


def _must_be_one_line(text: str) -> None:
    assert text.isprintable(), text


def _load_previews_settings(path: Path) -> PreviewSettings:
    return load(PreviewSettings, path)


class _Call:
    """A call that brings its own id."""

    def __init__(self, brought: str) -> None:
        self._brought = brought

    def invocation_metadata(self) -> list[tuple[str, str]]:
        return [("x-request-id", self._brought)]


def _parses(message: Message, data: bytes) -> bool:
    try:
        message.ParseFromString(data)
    except DecodeError:
        return False
    return True
