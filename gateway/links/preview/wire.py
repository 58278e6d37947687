"""Schema and client of the preview service (omniseer.preview.v1)."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import grpc

from common import request_id
from gateway.links.grpc_client import failed, lost, unix_channel
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.reconciler import Desired
from gateway.links.watch import LinkLostError
from gateway.links.wire_values import same_fields
from gateway.status.preview import (
    Camera,
    CameraState,
    Codec,
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    Profile,
    Stream,
)
from omniseer.preview.v1 import preview_service_pb2 as pb
from omniseer.preview.v1.preview_service_pb2_grpc import PreviewServiceStub

if TYPE_CHECKING:
    # Exists in the generated stubs alone: the name that a type checker knows the asyncio form by.
    from omniseer.preview.v1.preview_service_pb2_grpc import PreviewServiceAsyncStub

_FEEDBACK_DEADLINE_S: Final = 0.5
"""Of what viewers have passed on: later it is of no use."""
STATES: Final = {pb.LifecycleState.Value(f"LIFECYCLE_STATE_{state.name}"): state for state in PreviewState}
PROFILES: Final = {profile: pb.Profile.Value(f"PROFILE_{profile.name}") for profile in Profile}
CODECS: Final = {pb.Codec.Value(f"CODEC_{codec.name}"): codec for codec in Codec}
CAMERA_STATES: Final = {pb.CameraState.Value(f"CAMERA_STATE_{state.name}"): state for state in CameraState}
_PROFILE_OF: Final[Mapping[int, Profile]] = {number: profile for profile, number in PROFILES.items()}


@dataclass(frozen=True, slots=True)
class PreviewConnector:
    """Connects to the preview service on the Unix socket where it listens, or will."""

    socket: Path

    @asynccontextmanager
    async def connect(self) -> AsyncIterator["PreviewClient"]:
        """Yields a client; connects with its first call."""
        async with unix_channel(self.socket) as channel:
            yield PreviewClient(channel)


class PreviewClient:
    """A ServiceClient of the preview service."""

    def __init__(self, channel: grpc.aio.Channel) -> None:
        self._stub: PreviewServiceAsyncStub = PreviewServiceStub(channel)

    async def reports(self) -> AsyncIterator[PreviewReport]:
        """Yields what WatchActualState reports."""
        stream = self._stub.WatchActualState(pb.WatchActualStateRequest())
        try:
            while isinstance(message := await stream.read(), pb.WatchActualStateResponse):
                yield from_wire(message.actual)
        except grpc.aio.AioRpcError as error:
            raise lost(error) from None

    async def apply(self, desired: Desired[PreviewSpec]) -> PreviewReport:
        """Calls ApplyDesiredState under the id of the request that caused it."""
        metadata = ((request_id.HEADER, desired.request_id),) if desired.request_id else None
        try:
            reply = await self._stub.ApplyDesiredState(to_wire(desired), metadata=metadata)
        except grpc.aio.AioRpcError as error:
            raise failed(error) from None
        return from_wire(reply.actual)

    async def request_key_frame(self, newest_pts: int | None) -> bool:
        """Calls RequestKeyFrame; returns whether a key frame is forced for it."""
        request = pb.RequestKeyFrameRequest(newest_pts=newest_pts)
        try:
            reply = await self._stub.RequestKeyFrame(request, timeout=_FEEDBACK_DEADLINE_S)
        except grpc.aio.AioRpcError as error:
            raise failed(error) from None
        return reply.forced

    async def report_picture_age(self, age_ms: int) -> None:
        """Calls ReportPictureAge."""
        request = pb.ReportPictureAgeRequest(age_ms=age_ms)
        try:
            await self._stub.ReportPictureAge(request, timeout=_FEEDBACK_DEADLINE_S)
        except grpc.aio.AioRpcError as error:
            raise failed(error) from None


def to_wire(desired: Desired[PreviewSpec]) -> pb.ApplyDesiredStateRequest:
    """Returns the request that applies `desired`."""
    spec = desired.spec
    state = pb.DesiredState(
        revision=desired.revision, enabled=spec.enabled, passphrase=spec.passphrase, camera=spec.camera
    )
    if spec.profile:
        state.profile = PROFILES[spec.profile]
    return pb.ApplyDesiredStateRequest(desired=state)


def from_wire(message: pb.ActualState) -> PreviewReport:
    """Returns the report in a message.

    Raises:
        LinkLostError: the state is unknown, because the service is of another version than the gateway.
    """
    state = STATES.get(message.state)
    if state is None:
        raise LinkLostError(
            f"it reports the unknown state number {message.state}; its version does not match"
        )
    codec = CODECS.get(message.stream.codec)
    return PreviewReport(
        instance_id=message.instance_id,
        applied_revision=message.applied_revision,
        state=state,
        profile=_PROFILE_OF.get(message.profile),
        last_error=message.last_error,
        listener=same_fields(Listener, message.listener) if message.HasField("listener") else None,
        stream=same_fields(Stream, message.stream, codec=codec) if message.HasField("stream") else None,
        encoder=same_fields(Encoder, message.encoder) if message.HasField("encoder") else None,
        measurement=same_fields(Measurement, message.measurement)
        if message.HasField("measurement")
        else None,
        counters=same_fields(Counters, message.counters),
        wanted_camera=message.wanted_camera,
        cameras=tuple(
            same_fields(Camera, camera, state=CAMERA_STATES.get(camera.state)) for camera in message.cameras
        ),
    )
