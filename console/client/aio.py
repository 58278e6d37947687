"""The asyncio client. The blocking one (blocking.py) is a facade over it."""

import asyncio
import uuid
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Self, TypeVar

from common.tasks import cancel
from console.client import results
from console.client.clock import Clock, Offset
from console.client.drive_session import DriveOptions, DriveSession
from console.client.errors import DeadlineExceeded, Unreachable, Unsupported
from console.client.event_feed import EventFeed
from console.client.exporting import Export, ExportedRecording, ExportOptions, once_read
from console.client.file_stream import file_bytes
from console.client.mapping import recording
from console.client.mapping.driving import (
    enabled_request,
    reset_request,
    stop_request,
    velocity_request,
)
from console.client.mapping.methods import (
    CANCEL_UPLOAD,
    DELETE_RECORDING,
    GET_GATEWAY_INFO,
    GET_OVERLAY_SNAPSHOT,
    GET_RECORDING,
    GET_SYSTEM_STATUS,
    GET_THUMBNAIL,
    LIST_RECORDINGS,
    PIN_RECORDING,
    REPORT_PICTURE,
    REQUEST_KEY_FRAME,
    RESET_STOP,
    SEND_TELEOP_COMMAND,
    SET_TELEOP_ENABLED,
    START_RECORDING,
    STOP_RECORDING,
    STOP_ROBOT,
    TRIGGER_SNAPSHOT,
    UPLOAD_RECORDING,
    DesiredPreview,
    Method,
    key_frame_request,
    picture_request,
)
from console.client.options import ClientOptions
from console.client.streams import Outage, Streams
from console.client.transport import GrpcTransport
from console.client.unary import UnaryCalls
from console.client.uploading import UploadProgress, upload_progress
from console.client.whole_recording import with_all_files
from console.credentials import Credentials
from console.target import DEFAULT_TARGET, parse_target

ResultT = TypeVar("ResultT")


class AsyncGatewayClient:
    """Client of one robot's gateway. Belongs to the asyncio loop that it is created in.

    It connects at the first call and reconnects whenever the connection breaks. Cancelling a task that waits
    for an answer cancels the call.

    Example:
        async with AsyncGatewayClient("robot.local") as robot:
            status, overlay = await asyncio.gather(robot.status(), robot.overlay())

    Args:
        target: HOST or HOST:PORT.
        options: Deadlines, retries and keepalive.
        credentials: Token and certificates; None for a robot without authentication.

    Raises:
        UserError: The target is not an address, or the credentials would be sent in the clear. Every method
            raises a `GatewayError`.
    """

    def __init__(
        self,
        target: str = DEFAULT_TARGET,
        options: ClientOptions | None = None,
        credentials: Credentials | None = None,
    ) -> None:
        self.target = parse_target(target)
        self.clock = Clock()
        self._options, self._credentials = options or ClientOptions(), credentials or Credentials()
        self._transport = self._connect()
        self._calls = UnaryCalls(self._transport, self._options)
        self._streams = Streams(self._transport, self._options)
        self._within_s = self._options.answer_within_s
        self._second: GrpcTransport | None = None
        """For stops: a lost packet on one connection then delays nothing."""

    @property
    def reconnects(self) -> int:
        """Connections after the first one of each stream, of all streams together."""
        return self._streams.reconnects

    @property
    def retries(self) -> int:
        """Attempts beyond the first, of all calls together."""
        return self._calls.retries

    async def status(self) -> results.SystemStatus:
        """Returns the status of the whole robot."""
        return await self._calls.read(GET_SYSTEM_STATUS)

    async def overlay(self) -> results.OverlaySnapshot:
        """Returns status, detections and the newest events, all of one instant."""
        return await self._calls.read(GET_OVERLAY_SNAPSHOT)

    async def info(self) -> results.GatewayInfo:
        """Returns the gateway program's build, call counts and configuration."""
        return await self._calls.read(GET_GATEWAY_INFO)

    async def enable_preview(
        self,
        profile: results.PreviewProfile = results.PreviewProfile.UNKNOWN,
        *,
        camera: str = "",
        settle_within_s: float = 10.0,
    ) -> results.PreviewChange:
        """Turns the preview on, or changes its profile or camera, and waits until frames leave.

        Args:
            profile: UNKNOWN keeps the current one.
            camera: Name of one of `PreviewStatus.cameras`. Empty keeps the current one.
            settle_within_s: How long to wait for that; 0 returns the gateway's first answer.

        Returns:
            The gateway's message and the newest preview status: RUNNING, FAULTED (see `last_error`), or
            still STARTING when time ran out. A camera that fails leaves it RUNNING with the one before, or
            with its fallback (`PreviewStatus.live_camera`).

        Raises:
            InvalidRequest: There is no such camera; the text has the names.
        """
        desired = DesiredPreview(True, profile, camera)
        return await self.set_preview(desired, settle_within_s=settle_within_s)

    async def disable_preview(self, *, settle_within_s: float = 10.0) -> results.PreviewChange:
        """Turns the preview off and waits until its port is free; 0 returns the gateway's first answer."""
        return await self.set_preview(DesiredPreview(False), settle_within_s=settle_within_s)

    async def set_preview(
        self, desired: DesiredPreview, *, settle_within_s: float = 10.0
    ) -> results.PreviewChange:
        """Turns the preview on or off, as `enable_preview` and `disable_preview` do."""
        return await self._calls.set_preview(desired, settle_within_s)

    async def ping(self) -> Offset:
        """Returns the offset of the robot's clock. Each call improves `clock`."""
        return await self._calls.ping(self.clock)

    async def request_key_frame(self, newest_pts: int | None = None) -> results.KeyFrameAnswer:
        """Requests a key frame of the running preview, to repair a picture that lost packets have torn.

        Args:
            newest_pts: PTS of the newest picture of which anything was received. A key frame after it that
                has already been made serves the request; None asks for one that is still to come.

        Raises:
            Refused: The preview is not running.
            Overloaded: It was called more than three times a second.
        """
        return await self._calls.call(REQUEST_KEY_FRAME, key_frame_request(newest_pts), self._within_s)

    async def report_picture(self, report: results.PictureReport) -> None:
        """Reports the picture that a viewer shows; one to four times a second is enough."""
        await self._calls.call(REPORT_PICTURE, picture_request(report), self._within_s)

    def watch_status(
        self, min_interval_s: float = 0.1, *, include_detections: bool = False
    ) -> AsyncGenerator[results.WatchedStatus | Outage]:
        """Yields the status at once, on every change, and once a second without one. Never ends.

        A slow reader gets the newest next. A broken connection is made again; meanwhile an `Outage` comes
        for each failed attempt. Closing the iterator ends the stream on the robot.

        Args:
            min_interval_s: Least time between two statuses; the gateway looks for changes 20 times a second.
            include_detections: Whether each has the detections; new ones then count as a change.

        Raises:
            GatewayError: No gateway answers at the beginning, or it refuses; not for a later outage.
        """
        return self._streams.status(min_interval_s, include_detections=include_detections)

    def events(
        self,
        after: results.EventPosition | None = None,
        *,
        least: results.FaultSeverity = results.FaultSeverity.UNKNOWN,
    ) -> AsyncGenerator[results.Event | results.EventGap | results.CaughtUp | Outage]:
        """Yields each event once and in order; events that are not available any more, as an `EventGap`.

        `CaughtUp` comes after the last past event, and then as a keepalive. Every item but an `Outage` has
        the position to resume from, in another client or another run of the program. Never ends.

        Args:
            after: Position of the last item received; None begins with the oldest event kept.
            least: Events of lower severity are left out; UNKNOWN leaves out none.

        Raises:
            GatewayError: As `watch_status`.
        """
        return self._streams.events(EventFeed(after, least))

    def drive(self, options: DriveOptions | None = None) -> DriveSession:
        """Returns a session for driving, to be used in an `async with` block: its end stops the robot.

        Example:
            async with robot.drive(DriveOptions(supervision=Supervision.LINE_OF_SIGHT)) as session:
                await session.ready()
                await session.hold_for(1.0, vx_mps=0.1)

        Args:
            options: How to open the session.
        """
        return DriveSession(self._connect, options or DriveOptions(), self._within_s)

    async def stop_robot(self, reason: str = "") -> results.RobotStopped:
        """Stops the robot until `reset_stop`, no matter who drives it; returns when it has confirmed that.

        A stop of category 2 (IEC 60204-1): the motors stay powered. The call goes out on two connections; the
        first answer counts.

        Args:
            reason: For people.

        Raises:
            GatewayError: The robot has not confirmed it on either connection.
        """
        if self._second is None:
            self._second = self._connect()
        request = stop_request(_request_id(), reason)
        calls = (self._calls, UnaryCalls(self._second, self._options))
        attempts = [
            asyncio.create_task(each.call(STOP_ROBOT, request, self._within_s), name="stop") for each in calls
        ]
        return await _first_answer(attempts)

    async def reset_stop(self, stop_id: int) -> results.StopReset:
        """Resets a stop. Nothing moves by it.

        Args:
            stop_id: Of the stop that the caller has seen; a newer one stays.

        Raises:
            Refused: That stop is not the present one, or the driver holds.
        """
        return await self._calls.call(RESET_STOP, reset_request(stop_id), self._within_s)

    async def set_driving_enabled(self, enabled: bool) -> results.TeleopAnswer:
        """Enables or disables driving, for all. Disabling stops the robot and ends its driver's lease."""
        return await self._calls.call(SET_TELEOP_ENABLED, enabled_request(enabled), self._within_s)

    async def send_velocity(
        self, vx_mps: float, vy_mps: float = 0.0, wz_rad_s: float = 0.0
    ) -> results.TeleopAnswer:
        """Moves the robot for at most 500 ms, slowly, where it permits commands without hold-to-run.

        For tests of a robot with older tools; `drive` is safer, and not limited in this way.
        """
        request = velocity_request(vx_mps, vy_mps, wz_rad_s)
        return await self._calls.call(SEND_TELEOP_COMMAND, request, self._within_s)

    async def start_recording(
        self,
        label: str = "",
        *,
        notes: str = "",
        preset: str = "",
        with_video: bool | None = None,
        max_duration_s: int = 0,
        max_bytes: int = 0,
    ) -> results.RecordingAnswer:
        """Starts a recording on the robot's disk; returns when its first file is open.

        Args:
            label: Its name for people.
            notes: For people.
            preset: What to record, one of `RecordingStatus.presets`; empty is the robot's first.
            with_video: None as the preset says.
            max_duration_s: It stops by itself then; 0 for no limit.
            max_bytes: The same.

        Raises:
            Refused: Another one runs, or the disk has no room, for example.
        """
        request = recording.start_request(
            _request_id(),
            label=label,
            notes=notes,
            preset=preset,
            with_video=with_video,
            max_duration_s=max_duration_s,
            max_bytes=max_bytes,
        )
        return await self._call_recording(START_RECORDING, request)

    async def stop_recording(self, recording_id: str = "") -> results.RecordingAnswer:
        """Stops a recording, by default the one that runs; waits for its files, but 10 s at the most."""
        request = recording.stop_request(_request_id(), recording_id)
        return await self._call_recording(STOP_RECORDING, request)

    async def trigger_snapshot(
        self,
        label: str = "",
        *,
        pre_s: int | None = None,
        post_s: int | None = None,
        preset: str = "",
    ) -> results.RecordingAnswer:
        """Keeps the last seconds and the next ones; returns at once, with the recording that it becomes.

        Args:
            label: Its name for people.
            pre_s: Seconds before this call; None as configured on the robot.
            post_s: Seconds after it; the same.
            preset: What to keep of the ring; empty is all of it.
        """
        request = recording.snapshot_request(
            _request_id(), pre_s=pre_s, post_s=post_s, label=label, preset=preset
        )
        return await self._call_recording(TRIGGER_SNAPSHOT, request)

    async def list_recordings(self, page_size: int = 50, page_token: str = "") -> results.RecordingPage:
        """Returns a page of the list, the newest recording first, and the state of the recorder."""
        request = recording.list_request(page_size, page_token)
        return await self._call_recording(LIST_RECORDINGS, request)

    async def recordings(self) -> AsyncGenerator[results.Recording]:
        """Yields all recordings, the newest first; requests page after page."""
        async for page in self.recording_pages():
            for each in page.recordings:
                yield each

    async def recording_pages(self) -> AsyncGenerator[results.RecordingPage]:
        """Yields all pages of the list, the newest recordings first, each with the state of the recorder."""
        token, seen = "", set[str]()
        while True:
            page = await self.list_recordings(page_token=token)
            yield page
            token = page.next_page_token
            # A robot that repeats a token would be asked without an end.
            if not token or token in seen:
                return
            seen.add(token)

    async def recording(self, recording_id: str) -> results.Recording:
        """Returns a recording with all of its files, which the robot lists a page at a time, and its gaps.

        Raises:
            Unsupported: The robot's software is too old to list as many files.
        """

        async def page(token: str) -> results.RecordingFound:
            return await self._call_recording(GET_RECORDING, recording.get_request(recording_id, token))

        return await with_all_files(page)

    async def recording_thumbnail(self, recording_id: str) -> results.RecordingThumbnail:
        """Returns a coded key frame of a recording's video."""
        request = recording.thumbnail_request(recording_id)
        return await self._call_recording(GET_THUMBNAIL, request)

    async def pin_recording(self, recording_id: str, pinned: bool = True) -> results.RecordingAnswer:
        """Pins a recording, so that making room never deletes it; or ends that."""
        request = recording.pin_request(_request_id(), recording_id, pinned=pinned)
        return await self._call_recording(PIN_RECORDING, request)

    async def delete_recording(
        self, recording_id: str, *, expected_sha256: bytes = b"", force: bool = False
    ) -> results.RecordingDeleted:
        """Deletes a recording and its files.

        Args:
            recording_id: Which.
            expected_sha256: `Recording.sha256` as the caller has seen it; empty for any.
            force: Although it is pinned or not copied yet; for administrators.
        """
        request = recording.delete_request(
            _request_id(), recording_id, expected_sha256=expected_sha256, force=force
        )
        return await self._call_recording(DELETE_RECORDING, request)

    async def upload_recording(self, recording_id: str) -> results.UploadAnswer:
        """Requests that the robot copies a recording to its fleet's store; returns when it is in the queue.

        Raises:
            Refused: The robot is not set up for a fleet, or the recording has not ended, for example.
        """
        request = recording.upload_request(_request_id(), recording_id)
        return await self._call_recording(UPLOAD_RECORDING, request)

    async def cancel_upload(self, recording_id: str) -> results.UploadCancelled:
        """Takes a recording from the queue of those to be copied; a copy that is verified stays."""
        request = recording.cancel_upload_request(_request_id(), recording_id)
        return await self._call_recording(CANCEL_UPLOAD, request)

    def upload_progress(self, recording_id: str) -> AsyncGenerator[UploadProgress]:
        """Yields every second or so how far the copy of a recording is, until it is verified or cancelled.

        A broken connection is made again; the robot goes on copying without one.

        Args:
            recording_id: Of a recording that waits to be copied.
        """
        return upload_progress(self, recording_id)

    async def export_recording(
        self, recording_id: str | results.Recording, folder: Path, options: ExportOptions | None = None
    ) -> ExportedRecording:
        """Copies a recording to this computer; of one that is still written, what is final so far.

        It goes on by itself after a cut connection, and verifies every byte. Cancelled, it leaves NAME.part
        files, from which another export goes on.

        Args:
            recording_id: Which; or the recording with its files, as `recording()` has just returned it.
            folder: Gets the recording's files; made if it is not there.
            options: How to copy it.

        Raises:
            UserError: The folder can't be written, or has other files of the same names.
        """
        options = options or ExportOptions()
        found = await self.recording(recording_id) if isinstance(recording_id, str) else recording_id
        found = await once_read(found, self.recording, self._transport.sleep, options)
        return await Export(self._transport, found, folder, options).run()

    def read_recording(
        self, recording_id: str, file: results.RecordingFile, offset: int = 0
    ) -> AsyncGenerator[bytes]:
        """Yields the bytes of one final file of a recording, in chunks of at most 256 KiB.

        Over one connection: after a cut, the caller goes on at the offset that it has reached. Each chunk is
        checked against its CRC-32C, and `file.sha256` makes sure that it is still the same file. Closing the
        iterator ends the stream on the robot.

        Args:
            recording_id: Which.
            file: One of `Recording.files`.
            offset: Where to begin, in bytes.

        Raises:
            GatewayError: The connection is cut or silent for 30 s, a chunk is damaged, or the robot refuses.
        """
        return file_bytes(self._transport, recording_id, file, offset)

    async def _call_recording(self, method: Method[ResultT], request: bytes) -> ResultT:
        try:
            return await self._calls.call(method, request, self._options.recording_within_s)
        except Unsupported as error:
            raise Unsupported(
                f"the gateway at {self.target} is too old to record; nothing was changed",
                "Update it on the robot (docs/deploy.md); to see its version, type: robotctl info",
            ) from error

    def _connect(self) -> GrpcTransport:
        """Returns a connection of its own."""
        return GrpcTransport(self.target, self._options, self._credentials)

    async def close(self) -> None:
        """Closes the connections. Pending calls and streams in other tasks end with `Cancelled`."""
        await self._transport.close()
        if self._second:
            await self._second.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()


def _request_id() -> str:
    """Returns an ID by which the robot recognises a call that comes again, or on a second connection."""
    return uuid.uuid4().hex


async def _first_answer(attempts: "list[asyncio.Task[results.RobotStopped]]") -> results.RobotStopped:
    """Returns the first answer. No failure of one connection withdraws what the other still carries.

    Raises:
        GatewayError: all have failed; what the robot has said counts more than silence.
    """
    waiting, errors = set(attempts), list[BaseException]()
    try:
        while waiting:
            done, waiting = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            for each in done:
                error = each.exception()
                if error is None:
                    return each.result()
                errors.append(error)
        raise min(errors, key=lambda error: isinstance(error, Unreachable | DeadlineExceeded))
    finally:
        await cancel(attempts)
