"""What the gateway and the robot's other programs read of each other on their private sockets."""

import math
from collections import deque
from contextlib import suppress
from typing import Final

from google.protobuf.message import DecodeError

from drive.endpoint import wire as drive_wire
from drive.motion.machine import Observe, Rules, State, Tick, step
from drive.motion.values import ZERO, Surroundings
from gateway.links.bridge import wire as bridge_wire
from gateway.links.drive import wire as drive_link_wire
from gateway.links.recorder import wire as recorder_wire
from gateway.links.watch import LinkLostError
from gateway.rpc.mapping.cloud import cloud_status
from gateway.rpc.mapping.recording import recording_status
from gateway.rpc.mapping.teleop import drive_state, teleop_status
from gateway.status.cloud import CloudView
from gateway.status.event import ControlAction
from gateway.status.recording import RecorderView
from gateway.status.teleop import DriveView, TeleopView
from gateway.status.values import Received
from gateway.teleop.episodes import Episodes
from gateway.teleop.lane import DriveFacts
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.drive.v1 import drive_pb2
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb

NOW_NS: Final = 10**12
_NOW_S: Final = NOW_NS / 1e9
_NS_PER_MS: Final = 1_000_000
_ROUNDING: Final = 1e-9
_RULES: Final = Rules()
_CLEAR: Final = Surroundings(preview_running=True, newest_capture_ns=10**18, base_present=True, still=True)


def gateways_packets(data: bytes) -> None:
    """Packets of the gateway, in the drive program: no speed beyond the limits, no report beyond a packet.

    Before each packet are two bytes: the ms that pass before it arrives, and its length.
    """
    now_ns = NOW_NS
    state = step(State.at_start(now_ns, enabled=True), Observe(_CLEAR), now_ns, _RULES)
    with suppress(drive_wire.ProtocolError):
        while len(data) >= 2:
            now_ns += data[0] * _NS_PER_MS
            message, data = drive_wire.decoded(data[2 : 2 + data[1]]), data[2 + data[1] :]
            if event := drive_wire.event_of(message):
                state = step(state, event, now_ns, _RULES)
            state = step(state, Tick(), now_ns, _RULES)
            _check_motion(state, now_ns)


def drives_report(data: bytes) -> None:
    """A packet of the drive program, in the gateway: it can be recorded and sent to operators."""
    message = drive_pb2.FromDrive()
    with suppress(DecodeError, LinkLostError):
        message.ParseFromString(data)
        actual = drive_link_wire.report_from(message.welcome, message.actual)
        recorded = _Recorded()
        if actual.episode:
            Episodes(recorded).record(actual.instance_id, actual.episode)
        assert all(each.request for each in recorded.actions)
        drive = DriveView(enabled=True, applied=True, error="", actual=actual)
        teleop_status(TeleopView(drive, actual.inhibits), _NOW_S).SerializeToString()
        facts = DriveFacts(
            now_ns=NOW_NS,
            drive=drive,
            phase=drive.phase,
            inhibits=actual.inhibits,
            newest_sequence=0,
            command_age_ms=0,
            loop_age_ms=0,
            picture_age_ms=None,
        )
        drive_state(facts).SerializeToString()


def recorders_report(data: bytes) -> None:
    """A report of the recorder, in the gateway: what comes of it can be sent to operators."""
    message = recorder_pb.WatchStateResponse()
    with suppress(DecodeError, LinkLostError):
        message.ParseFromString(data)
        report = recorder_wire.report_from(message)
        assert report.missing >= 0
        recording_status(RecorderView("", Received(report, _NOW_S))).SerializeToString()


def bridges_report(data: bytes) -> None:
    """A report of the bridge, in the gateway: short and printable, as far as it is for operators."""
    message = bridge_pb.WatchStateResponse()
    with suppress(DecodeError, LinkLostError):
        message.ParseFromString(data)
        report = bridge_wire.report_from(message, _NOW_S)
        assert len(report.copies) <= bridge_wire.MOST_COPIES
        assert len(report.requests) <= bridge_wire.MOST_REQUESTS
        for request in report.requests:
            assert request.issued_by.isascii()
            assert (request.request_id + request.issued_by + request.label).isprintable()
        view = CloudView("", _NOW_S, Received(report, _NOW_S))
        status = cloud_status(view, _NOW_S + 1)
        texts = (status.robot, status.fleet, status.uploading_id, status.uploads_paused, status.last_error)
        assert all(each.isprintable() and len(each) <= bridge_wire.LONGEST_TEXT for each in texts)


class _Recorded:
    """An audit log in memory, of one record."""

    def __init__(self) -> None:
        self.actions: deque[ControlAction] = deque(maxlen=1)

    def record_action(self, action: ControlAction) -> None:
        """Takes an action."""
        self.actions.append(action)


def _check_motion(state: State, now_ns: int) -> None:
    velocity, limits = state.output or ZERO, _RULES.limits
    for value, limit in (
        (velocity.vx_mps, limits.vx_mps),
        (velocity.vy_mps, limits.vy_mps),
        (velocity.wz_rad_s, limits.wz_rad_s),
    ):
        assert math.isfinite(value)
        assert abs(value) <= limit + _ROUNDING
    assert velocity == ZERO or (state.lease and state.command and not state.latch)
    report = drive_wire.actual_state(
        state, _RULES, now_ns, revision=0, counters=drive_pb2.Counters(), episode=None, problems=[]
    )
    assert drive_pb2.FromDrive(actual=report).ByteSize() <= drive_wire.MAX_MESSAGE_BYTES
