"""The messages of recordings."""

from console.client import results
from console.client.mapping.reader import read
from omniseer.gateway.v1 import recording_pb2 as wire


def start_request(
    request_id: str,
    *,
    label: str = "",
    notes: str = "",
    preset: str = "",
    with_video: bool | None = None,
    max_duration_s: int = 0,
    max_bytes: int = 0,
) -> bytes:
    """Returns the request of StartRecording."""
    return wire.StartRecordingRequest(
        request_id=request_id,
        label=label,
        notes=notes,
        preset=preset,
        with_video=with_video,
        max_duration_s=max_duration_s,
        max_bytes=max_bytes,
    ).SerializeToString()


def stop_request(request_id: str, recording_id: str) -> bytes:
    """Returns the request of StopRecording; an empty ID is the recording that runs."""
    return wire.StopRecordingRequest(request_id=request_id, recording_id=recording_id).SerializeToString()


def snapshot_request(
    request_id: str, *, pre_s: int | None, post_s: int | None, label: str, preset: str
) -> bytes:
    """Returns the request of TriggerSnapshot."""
    return wire.TriggerSnapshotRequest(
        request_id=request_id, pre_s=pre_s, post_s=post_s, label=label, preset=preset
    ).SerializeToString()


def list_request(page_size: int, page_token: str) -> bytes:
    """Returns the request of ListRecordings."""
    return wire.ListRecordingsRequest(page_size=page_size, page_token=page_token).SerializeToString()


def get_request(recording_id: str, page_token: str = "") -> bytes:
    """Returns the request of GetRecording."""
    return wire.GetRecordingRequest(recording_id=recording_id, page_token=page_token).SerializeToString()


def thumbnail_request(recording_id: str) -> bytes:
    """Returns the request of GetRecordingThumbnail."""
    return wire.GetRecordingThumbnailRequest(recording_id=recording_id).SerializeToString()


def export_request(
    recording_id: str, file: str, *, offset: int, expected_sha256: bytes, max_bytes_per_s: int
) -> bytes:
    """Returns the request of ExportRecording."""
    return wire.ExportRecordingRequest(
        recording_id=recording_id,
        file=file,
        offset=offset,
        expected_sha256=expected_sha256,
        max_bytes_per_s=max_bytes_per_s,
    ).SerializeToString()


def pin_request(request_id: str, recording_id: str, *, pinned: bool) -> bytes:
    """Returns the request of PinRecording."""
    return wire.PinRecordingRequest(
        request_id=request_id, recording_id=recording_id, pinned=pinned
    ).SerializeToString()


def delete_request(request_id: str, recording_id: str, *, expected_sha256: bytes, force: bool) -> bytes:
    """Returns the request of DeleteRecording."""
    return wire.DeleteRecordingRequest(
        request_id=request_id, recording_id=recording_id, expected_sha256=expected_sha256, force=force
    ).SerializeToString()


def upload_request(request_id: str, recording_id: str) -> bytes:
    """Returns the request of UploadRecording."""
    return wire.UploadRecordingRequest(request_id=request_id, recording_id=recording_id).SerializeToString()


def cancel_upload_request(request_id: str, recording_id: str) -> bytes:
    """Returns the request of CancelUpload."""
    return wire.CancelUploadRequest(request_id=request_id, recording_id=recording_id).SerializeToString()


def export_item(message: wire.ExportRecordingResponse) -> results.ExportHeader | results.ExportChunk | None:
    """Returns the next part of an export; None for a kind that only a newer client knows."""
    match message.WhichOneof("part"):
        case "header":
            return read(results.ExportHeader, message.header)
        case "chunk":
            return read(results.ExportChunk, message.chunk)
        case _:
            return None
