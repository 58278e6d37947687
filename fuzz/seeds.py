"""Good inputs to begin with: a fuzzer that starts from nothing takes long to learn a format."""

import hashlib
import struct
from typing import Any, Final

import grpc
from mcap.records import Channel, Message, Schema
from rclpy.serialization import serialize_message

from common import camera_tap
from common.ca import new_ca
from common.errors import FieldViolation, InvalidRequestError
from common.grpc_errors import metadata_of
from common.video_tap import Header, Kind, encode_object
from console.capture_time import WRAP_TICKS
from fuzz import recording
from fuzz.fleet import REQUESTS, ROBOT
from fuzz.network import FULL_NAME
from fuzz.programs import NOW_NS
from fuzz.robot import SOURCES, type_of
from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from omniseer.drive.v1 import drive_pb2
from omniseer.fleet.v1 import command_pb2, state_pb2, upload_pb2
from omniseer.gateway.v1 import (
    cloud_pb2,
    event_pb2,
    overlay_pb2,
    pose_pb2,
    preview_pb2,
    recording_pb2,
    robot_gateway_pb2,
    states_pb2,
    system_status_pb2,
    teleop_pb2,
    value_pb2,
)
from omniseer.preview.v1 import preview_service_pb2 as preview_pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from recorder.mcap.records import bytes_of
from tests.support.image_messages import BIG, compressed_image, image, jpeg_header, png
from tests.support.mpegts_writer import PACKET_BYTES, Writer, coded_frame

_STATUS: Final = system_status_pb2.SystemStatus(
    gateway_name="lab",
    preview=preview_pb2.PreviewStatus(state=states_pb2.PREVIEW_RUNNING, last_error="why"),
    health=system_status_pb2.RobotHealth(ready=True, summary="robot healthy", odom_age_ms=12),
    mission=system_status_pb2.MissionStatus(available=True, mode="exploring"),
)
_ACTUAL: Final = preview_pb.ActualState(
    instance_id="a1",
    applied_revision=7,
    state=preview_pb.LIFECYCLE_STATE_RUNNING,
    profile=preview_pb.PROFILE_BALANCED,
    stream=preview_pb.Stream(width_px=1280, height_px=720, fps=30, codec=preview_pb.CODEC_H265),
    measurement=preview_pb.Measurement(fps=29.5, viewer_count=2, worst_rtt_ms=4),
)
_DESIRED_STATE: Final = preview_pb.DesiredState(
    revision=8,
    enabled=True,
    profile=preview_pb.PROFILE_LOW_BW,
    passphrase="0123456789",  # noqa: S106  # made up
)


_VALUES: Final = system_status_pb2.SystemStatus(
    numbers=[value_pb2.NumberStatus(label="motor", title="Motor", available=True, value=61.5, unit="V")],
    texts=[value_pb2.TextStatus(label="arm", available=True, text="open", level=value_pb2.TEXT_LEVEL_ERROR)],
    position=pose_pb2.PositionStatus(available=True, latitude_deg=47.5, longitude_deg=8.25),
    orientation=pose_pb2.OrientationStatus(available=True, roll_deg=1.5, pitch_deg=0.5, yaw_deg=3.5),
)
_FLEET_STATE: Final = state_pb2.RobotState(
    robot=ROBOT,
    gateway_reachable=True,
    faults=[state_pb2.FaultBrief(fault_id="lidar.stale", message="lidar silent")],
    numbers=_VALUES.numbers,
    texts=_VALUES.texts,
    position=_VALUES.position,
)


_OVERLAY: Final = overlay_pb2.OverlaySnapshot(
    status=_STATUS,
    detections=overlay_pb2.DetectionOverlayStatus(
        detections=[overlay_pb2.OverlayDetection(class_name="person", score=0.5)]
    ),
)


def _video(codec: str, *pts_ticks: int) -> bytes:
    """A key frame and those after it at these times, in the form of the target."""
    writer = Writer(codec)
    tables = writer.tables()
    packets = [tables[:PACKET_BYTES], tables[PACKET_BYTES:]]
    for number, ticks in enumerate(pts_ticks):
        packets += writer.unit(coded_frame(codec, number, key=number == 0), ticks)
    return b"".join(bytes([number]) + packet for number, packet in enumerate(packets))


def _tap() -> bytes:
    """The beginning of a connection: what comes, two frames, and some that are missing."""
    unit = b"".join(b"\0\0\1" + bytes([kind]) + b"data" for kind in (7, 8, 5))
    at_ns = recording.NOW.monotonic_ns
    frame = Header(Kind.ACCESS_UNIT, len(unit), key_frame=True, captured_ns=at_ns).encode() + unit
    info = encode_object(Kind.INFO, {"state": "running", "codec": "h264", "error": ""})
    gap = encode_object(Kind.GAP, {"frames": 2, "from_ns": at_ns, "to_ns": at_ns + 1})
    unpaired = encode_object(Kind.INFO, {"state": "faulted", "error": "\ud800"})
    return info + frame + gap + frame + unpaired


def _chunk_content() -> bytes:
    """A schema, a channel and a message."""
    return bytes(
        bytes_of(
            [
                Schema(id=1, name="std_msgs/msg/String", encoding="ros2msg", data=b"string data"),
                Channel(id=1, topic="/a", message_encoding="cdr", metadata={}, schema_id=1),
                Message(channel_id=1, log_time=5, publish_time=5, sequence=1, data=b"data"),
            ]
        )
    )


def _receivers_requests() -> list[bytes]:
    """One of each, in the form of the target."""
    file = recording_pb2.RecordingFile(name="data.mcap", size=3, sha256=bytes(32))
    empty = recording_pb2.RecordingFile(name="empty.mcap", sha256=hashlib.sha256().digest())
    requests = (
        ("begin_upload", upload_pb2.BeginUploadRequest(recording=recording_pb2.Recording(id="r1"))),
        ("begin_file", upload_pb2.BeginFileRequest(recording_id="r1", file=file)),
        ("begin_file", upload_pb2.BeginFileRequest(recording_id="r1", file=empty)),
        (
            "get_parts",
            upload_pb2.GetPartsRequest(
                recording_id="r1", file_name="data.mcap", file_size=3, upload_id="u1", numbers=[1]
            ),
        ),
        (
            "complete_file",
            upload_pb2.CompleteFileRequest(
                recording_id="r1", file_name="a", upload_id="u1", parts=[upload_pb2.Part(number=1, etag="e")]
            ),
        ),
        ("verify_file", upload_pb2.VerifyFileRequest(recording_id="r1", file=file)),
        (
            "complete_upload",
            upload_pb2.CompleteUploadRequest(
                recording=recording_pb2.Recording(id="r1", size=3), file_names=["a"]
            ),
        ),
        ("get_files", upload_pb2.GetFilesRequest(recording_id="r1", file_names=["a"])),
    )
    return [bytes([REQUESTS.index(name)]) + each.SerializeToString() for name, each in requests]


def _drive_packets() -> bytes:
    """A lease, a command, a stop and its reset, in the form of the target."""
    packets = (
        drive_pb2.ToDrive(grant=drive_pb2.GrantLease(session_id="s1", holder="anna", streaming=True)),
        drive_pb2.ToDrive(
            command=drive_pb2.Command(
                session_id="s1",
                sequence=1,
                held=True,
                vx_mps=0.2,
                valid_until_ns=2 * NOW_NS,
                echo_ns=NOW_NS,
                picture_ns=NOW_NS,
            )
        ),
        drive_pb2.ToDrive(stop=drive_pb2.Stop(by="ben", reason="a person")),
        drive_pb2.ToDrive(reset=drive_pb2.Reset(stop_id=1)),
        drive_pb2.ToDrive(end=drive_pb2.EndLease(session_id="s1", why=drive_pb2.LEASE_END_CLOSED)),
    )
    contents = [each.SerializeToString() for each in packets]
    return b"".join(bytes((20, len(each))) + each for each in contents)


def _drive_report() -> bytes:
    """One message has either a welcome or a state; what fails to decode is left to the fuzzer."""
    actual = drive_pb2.ActualState(
        monotonic_ns=NOW_NS,
        applied_revision=3,
        phase=drive_pb2.PHASE_STOPPED,
        inhibits=[drive_pb2.INHIBIT_PICTURE_STALE],
        session_id="s1",
        vx_mps=0.2,
        stop=drive_pb2.Latch(stop_id=1, by="ben", reason="a person", since_ns=NOW_NS - 1),
        episode=drive_pb2.Episode(
            episode_id=1, holder="anna", started_ns=1, ended_ns=1 << 62, distance_m=2.0, ended_by="released"
        ),
        problems=["no odometry"],
    )
    return drive_pb2.FromDrive(actual=actual).SerializeToString()


def _refusal(retry_after_s: float) -> bytes:
    """A refusal with all the details that there are, in the form of the target."""
    error = InvalidRequestError("two things", (FieldViolation("min_interval_ms", "is too much"),))
    error.retry_after_s = retry_after_s
    details = dict(metadata_of(error, grpc.StatusCode.INVALID_ARGUMENT))["grpc-status-details-bin"]
    assert isinstance(details, bytes)  # the value of a key that ends in "-bin"
    return bytes((3, 10)) + b"two things" + details


_SEEDS: Final = {
    "operators_request": [
        robot_gateway_pb2.SetPreviewModeRequest(
            enabled=True, profile=preview_pb2.PREVIEW_PROFILE_LOW_BW
        ).SerializeToString(),
        robot_gateway_pb2.WatchSystemStatusRequest(min_interval_ms=100).SerializeToString(),
        robot_gateway_pb2.RequestKeyFrameRequest(newest_pts=1 << 32).SerializeToString(),
        robot_gateway_pb2.ReportPictureRequest(
            viewer_id="left",
            picture_age_ms=140,
            rtt_ms=20,
            loss_percent=2.5,
            delivery=preview_pb2.PICTURE_DELIVERY_DIRECT,
        ).SerializeToString(),
        teleop_pb2.StopRobotRequest(reason="a person", request_id="s1").SerializeToString(),
        teleop_pb2.ResetStopRequest(stop_id=7).SerializeToString(),
        teleop_pb2.DriveRequest(
            open=teleop_pb2.DriveOpen(client_name="window", take_over=True, session_id="s1")
        ).SerializeToString(),
        teleop_pb2.DriveRequest(command=teleop_pb2.DriveCommand(sequence=9)).SerializeToString(),
        recording_pb2.StartRecordingRequest(request_id="r1", label="a run").SerializeToString(),
        recording_pb2.ExportRecordingRequest(
            recording_id="20260101-120000-ab12", file="data.mcap", offset=1 << 40, expected_sha256=bytes(32)
        ).SerializeToString(),
        recording_pb2.DeleteRecordingRequest(request_id="r2", recording_id="r1").SerializeToString(),
    ],
    "gateways_request": [preview_pb.ApplyDesiredStateRequest(desired=_DESIRED_STATE).SerializeToString()],
    "previews_report": [_ACTUAL.SerializeToString()],
    "robots_answer": [_STATUS.SerializeToString(), _OVERLAY.SerializeToString()],
    "configuration": [
        b"name: lab\ngrpc: {host: 127.0.0.1, port: 50051}\nsources: []\n",
        b"srt: {port: 7100}\nsource: {kind: file, path: /a.mp4}\nencoders: {order: [x264]}\n",
    ],
    "metrics_request": [b"GET /metrics HTTP/1.1\r\nHost: robot\r\n\r\n"],
    "request_id": [b"shift-7:42"],
    "token": [b"rgt-0123456789ab." + b"A" * 43],
    "credential_list": [
        b'{"version": 1, "credentials": [{"id": "0123456789ab", "name": "anna", "role": "operator", '
        b'"kind": "token", "proof": "' + b"0" * 64 + b'", "made": 1, "begins": null, "ends": null, '
        b'"revoked": null}]}'
    ],
    "login": [
        b"# Robot Gateway login 1\nrobot: lab2\nname: anna\nrole: operator\ntoken: rgt-0123456789ab."
        + b"A" * 43
        + b"\nauthority:\n-----BEGIN CERTIFICATE-----\n"
    ],
    "certificate": [new_ca("lab2", 100).certificate],
    "trial_result": [b'{"error": "", "fps": 29.5}', b'{"error": "no such element"}'],
    "terminal_text": ["robot healthy\x1b]0;x\x07\u202e\u00fc".encode()],
    "audit_line": [b"enabled: true, profile: LOW_BW"],
    "admission": [bytes((0, 8, 1, 0, 4, 0, 2, 1, 8, 0, 7, 90, 8, 0, 3, 1, 5, 0, 6, 0))],
    "hubs_command": [
        command_pb2.Command(
            command_id="c1",
            robot="lab2",
            issued_by="anna",
            expires_after_s=60,
            snapshot=command_pb2.SnapshotCommand(pre_s=20, label="door"),
        ).SerializeToString()
    ],
    "gateways_event": [
        robot_gateway_pb2.SubscribeEventsResponse(
            event=event_pb2.Event(run_id="a", sequence=5, message="a fault")
        ).SerializeToString()
    ],
    "video_stream": [
        _video("h264", 0, 3000),
        _video("h265", 0, 3000),
        # Each half a wrap from the last one: backwards, as far as a receiver can say.
        _video("h264", 0, WRAP_TICKS // 2, 0, WRAP_TICKS // 2),
    ],
    "video_tap": [_tap()],
    "camera_taps_packet": [
        camera_tap.encode_text(camera_tap.Kind.PROBLEM, "no camera"),
        camera_tap.encode_watch("/camera/image_raw"),
        camera_tap.STATUS_REQUEST,
        camera_tap.encode_examine("/camera/image_raw"),
    ],
    "image_message": [
        b"\0" + image("bgr8", 4, 2, 12, bytes(24)),
        b"\0" + image("nv12", 4, 2, 4, bytes(12), order=BIG, big_endian=1),
        b"\0" + image("mono16", 3, 2, 8, bytes(16)),
        b"\xff" + compressed_image(jpeg_header(8, 8, before=b"\xff\xfe\x00\x04hi")),
        b"\xff" + compressed_image(png(2, 2)),
    ],
    "segment": [b"\0" + recording.unfinished(), b"\1" + _chunk_content()],
    "export_request": [
        recording_pb2.ExportRecordingRequest(
            recording_id=recording.RECORDING, file=recording.FILE, offset=100
        ).SerializeToString(),
        recording_pb2.ExportRecordingRequest(
            recording_id=recording.RECORDING, file="../manifest.json", expected_sha256=bytes(32)
        ).SerializeToString(),
    ],
    "gateways_packets": [_drive_packets()],
    "drives_report": [_drive_report()],
    "recorders_report": [
        recorder_pb.WatchStateResponse(
            instance_id="a1",
            status=recording_pb2.RecordingStatus(state=recording_pb2.RECORDER_STATE_RECORDING),
            newest=recording_pb2.Recording(id=recording.RECORDING, label="door"),
        ).SerializeToString()
    ],
    "bridges_report": [
        bridge_pb.WatchStateResponse(
            instance_id="a1",
            status=cloud_pb2.CloudStatus(
                state=cloud_pb2.CLOUD_STATE_CONNECTED, robot="lab2", last_error="why"
            ),
            requests=[bridge_pb.HubRequest(request_id="c1", issued_by="anna", remaining_ms=5000)],
        ).SerializeToString()
    ],
    "hubs_content": [_FLEET_STATE.SerializeToString(), _FLEET_STATE.SerializeToString()[:40]],
    "gateways_status": [_VALUES.SerializeToString()],
    "receivers_request": _receivers_requests(),
    "kernels_answer": [
        struct.pack("=IHHII", 36, 24, 0, 1, 0)
        + struct.pack("=BBBBBBBBI", 2, 32, 0, 0, 0, 0, 0, 1, 0)
        + struct.pack("=HHi", 8, 4, 2)
    ],
    "field_path": [b"\0cell_voltage[1]", b"\1status[0].level", b"\2pose.covariance[35]"],
    "gateways_refusal": [_refusal(each) for each in (0.25, -1.0, 1e10)],
    "announcement": [
        bytes((5, 1, 0xC3, 0x83)) + b"lab 1" + bytes((10, 0, 0, 2)) + b"\x09name=lab1\x05tls=1",
        bytes((5, 4, 0xC3, 0x83)) + b"lab 1" + bytes((0xFE, 0x80, *bytes(13), 2)) + b"\x11contract=omniseer",
        bytes((5, 4, 0xC3, 0x83)) + b"lab 1" + bytes((*bytes(10), 0xFF, 0xFF, 10, 0, 0, 2)),
        bytes((18, FULL_NAME + 1, 0xC3, 0x83)) + b"lab._o._tcp.local." + bytes((10, 0, 0, 2)),
    ],
    "known_robots": [b'default = "lab2"\n[robots.lab2]\ntarget = "10.0.0.5:50051"\n'],
}


def of(target: str) -> list[bytes]:
    """For the target of this name."""
    if target in {"long_list", "robots_message"}:
        return [bytes([index]) + serialize_message(_message(source)) for index, source in enumerate(SOURCES)]
    return _SEEDS[target]


def _message(source: Any) -> Any:
    message = type_of(source)()
    for name in ("detections", "status"):
        if hasattr(message, name):
            item = _item(source.type)
            setattr(message, name, [item, item])
    if hasattr(message, "data"):
        message.data = "exploring"
    return message


def _item(message_type: str) -> Any:
    match message_type:
        case "yolo_msgs/msg/DetectionArray":
            from yolo_msgs.msg import Detection  # noqa: PLC0415  # whichever of them is asked for

            return Detection(class_name="person", score=0.5)
        case "vision_msgs/msg/Detection2DArray":
            from vision_msgs.msg import Detection2D, ObjectHypothesisWithPose  # noqa: PLC0415

            return Detection2D(results=[ObjectHypothesisWithPose()])
        case _:
            from diagnostic_msgs.msg import DiagnosticStatus  # noqa: PLC0415

            return DiagnosticStatus(name="motor", message="hot", level=b"\x02")
