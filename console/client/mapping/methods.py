"""The contract's methods: the bytes of their requests, and results from the bytes of their answers."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Final, Generic, TypeVar

from google.protobuf.descriptor import ServiceDescriptor
from google.protobuf.message_factory import GetMessageClass

from console.client import results
from console.client.mapping import enums
from console.client.mapping.driving import drive_item
from console.client.mapping.events import event_item
from console.client.mapping.reader import read
from console.client.mapping.recording import export_item
from console.client.results import EventPosition, FaultSeverity, PictureReport, PreviewProfile
from omniseer.gateway.v1 import event_pb2, fault_pb2, preview_pb2, recording_pb2, teleop_pb2
from omniseer.gateway.v1 import robot_gateway_pb2 as wire

_SERVICE: Final = wire.DESCRIPTOR.services_by_name["RobotGateway"]
_TELEOP: Final = teleop_pb2.DESCRIPTOR.services_by_name["TeleopService"]
_RECORDING: Final = recording_pb2.DESCRIPTOR.services_by_name["RecordingService"]
_MS_PER_S: Final = 1000

ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class DesiredPreview:
    """Desired state of the preview. UNKNOWN keeps the current profile, an empty name the current camera."""

    enabled: bool
    profile: PreviewProfile = PreviewProfile.UNKNOWN
    camera: str = ""


@dataclass(frozen=True, slots=True)
class Method(Generic[ResultT]):
    """One method of the contract.

    Args:
        name: As in the schema.
        result: Reads the answer message.
        idempotent: Whether two calls have the effect of one, so that a call may be retried.
        service: That it belongs to.
    """

    name: str
    result: Callable[[Any], ResultT]
    idempotent: bool = True
    service: ServiceDescriptor = _SERVICE

    @property
    def path(self) -> str:
        """The method's path in HTTP/2, as gRPC forms it: /package.Service/Method."""
        return f"/{self.service.full_name}/{self.name}"

    def decode(self, data: bytes) -> ResultT:
        """Returns the result of the answer's bytes.

        Raises:
            DecodeError: They are not an answer of this method.
        """
        answer = GetMessageClass(self.service.methods_by_name[self.name].output_type)
        return self.result(answer.FromString(data))


NO_FIELDS: Final = b""
"""The request of a method without parameters: a message without fields."""


def preview_request(desired: DesiredPreview) -> bytes:
    """Returns the request of SetPreviewMode."""
    profile = enums.number(desired.profile, preview_pb2.PreviewProfile.DESCRIPTOR)
    request = wire.SetPreviewModeRequest(enabled=desired.enabled, profile=profile, camera=desired.camera)
    return request.SerializeToString()


def key_frame_request(newest_pts: int | None) -> bytes:
    """Returns the request of RequestKeyFrame.

    Args:
        newest_pts: Of the newest picture of which anything was received; None leaves it open.
    """
    return wire.RequestKeyFrameRequest(newest_pts=newest_pts).SerializeToString()


def picture_request(report: PictureReport) -> bytes:
    """Returns the request of ReportPicture."""
    values = {each.name: getattr(report, each.name) for each in fields(report)}
    values["delivery"] = enums.number(report.delivery, preview_pb2.PictureDelivery.DESCRIPTOR)
    return wire.ReportPictureRequest(**values).SerializeToString()


def watch_request(min_interval_s: float, *, include_detections: bool) -> bytes:
    """Returns the request of WatchSystemStatus.

    Args:
        min_interval_s: Least time between two statuses.
        include_detections: Whether each carries the detections; new ones then count as a change.
    """
    return wire.WatchSystemStatusRequest(
        min_interval_ms=round(min_interval_s * _MS_PER_S), include_detections=include_detections
    ).SerializeToString()


def events_request(after: EventPosition | None, least: FaultSeverity) -> bytes:
    """Returns the request of SubscribeEvents.

    Args:
        after: Where to resume; None begins with the oldest event that the gateway keeps.
        least: Events of lower severity are left out; UNKNOWN leaves out none.
    """
    severity = enums.number(least, fault_pb2.FaultSeverity.DESCRIPTOR)
    position = event_pb2.EventPosition(run_id=after.run_id, sequence=after.sequence) if after else None
    return wire.SubscribeEventsRequest(after=position, min_severity=severity).SerializeToString()


GET_SYSTEM_STATUS: Final = Method("GetSystemStatus", partial(read, results.SystemStatus))
# Idempotent, because a request names the desired state, not a change.
SET_PREVIEW_MODE: Final = Method("SetPreviewMode", partial(read, results.PreviewChange))
GET_OVERLAY_SNAPSHOT: Final = Method("GetOverlaySnapshot", partial(read, results.OverlaySnapshot))
GET_GATEWAY_INFO: Final = Method("GetGatewayInfo", partial(read, results.GatewayInfo))
# A retry would come too late: the caller requests again while its picture is torn.
REQUEST_KEY_FRAME: Final = Method("RequestKeyFrame", partial(read, results.KeyFrameAnswer), idempotent=False)
# The next report is newer than a retry.
REPORT_PICTURE: Final[Method[None]] = Method("ReportPicture", lambda _: None, idempotent=False)
PING: Final = Method("Ping", partial(read, results.RobotTime))
WATCH_SYSTEM_STATUS: Final = Method("WatchSystemStatus", partial(read, results.WatchedStatus))
SUBSCRIBE_EVENTS: Final = Method("SubscribeEvents", event_item)
SET_TELEOP_ENABLED: Final = Method("SetTeleopEnabled", partial(read, results.TeleopAnswer))
# A retry would move the robot for longer than requested.
SEND_TELEOP_COMMAND: Final = Method(
    "SendTeleopCommand", partial(read, results.TeleopAnswer), idempotent=False
)
DRIVE: Final = Method("Drive", drive_item, idempotent=False, service=_TELEOP)
STOP_ROBOT: Final = Method("StopRobot", partial(read, results.RobotStopped), service=_TELEOP)
RESET_STOP: Final = Method("ResetStop", partial(read, results.StopReset), idempotent=False, service=_TELEOP)
# Idempotent by their request_id, all that change something.
_recording_answer: Final = partial(read, results.RecordingAnswer)
START_RECORDING: Final = Method("StartRecording", _recording_answer, service=_RECORDING)
STOP_RECORDING: Final = Method("StopRecording", _recording_answer, service=_RECORDING)
TRIGGER_SNAPSHOT: Final = Method("TriggerSnapshot", _recording_answer, service=_RECORDING)
PIN_RECORDING: Final = Method("PinRecording", _recording_answer, service=_RECORDING)
LIST_RECORDINGS: Final = Method("ListRecordings", partial(read, results.RecordingPage), service=_RECORDING)
GET_RECORDING: Final = Method("GetRecording", partial(read, results.RecordingFound), service=_RECORDING)
GET_THUMBNAIL: Final = Method(
    "GetRecordingThumbnail", partial(read, results.RecordingThumbnail), service=_RECORDING
)
DELETE_RECORDING: Final = Method(
    "DeleteRecording", partial(read, results.RecordingDeleted), service=_RECORDING
)
UPLOAD_RECORDING: Final = Method("UploadRecording", partial(read, results.UploadAnswer), service=_RECORDING)
CANCEL_UPLOAD: Final = Method("CancelUpload", partial(read, results.UploadCancelled), service=_RECORDING)
EXPORT_RECORDING: Final = Method("ExportRecording", export_item, service=_RECORDING)
METHODS: Final = (
    GET_SYSTEM_STATUS,
    SET_PREVIEW_MODE,
    GET_OVERLAY_SNAPSHOT,
    GET_GATEWAY_INFO,
    PING,
    REQUEST_KEY_FRAME,
    REPORT_PICTURE,
    SET_TELEOP_ENABLED,
    SEND_TELEOP_COMMAND,
    STOP_ROBOT,
    RESET_STOP,
    START_RECORDING,
    STOP_RECORDING,
    TRIGGER_SNAPSHOT,
    LIST_RECORDINGS,
    GET_RECORDING,
    GET_THUMBNAIL,
    PIN_RECORDING,
    DELETE_RECORDING,
    UPLOAD_RECORDING,
    CANCEL_UPLOAD,
)
"""The unary methods."""
STREAMS: Final = (WATCH_SYSTEM_STATUS, SUBSCRIBE_EVENTS, EXPORT_RECORDING)
"""The server-streaming methods. A test compares both lists, and DRIVE, with the schema."""
