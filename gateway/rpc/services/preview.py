"""The live preview: switched on and off; what its viewers request and report."""

from dataclasses import dataclass

from gateway.links.preview.control import PreviewControl
from gateway.links.preview.feedback import Feedback
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.ports import PictureSink
from gateway.rpc.calls.recipient import Recipients
from gateway.rpc.mapping.enums import profile_from
from gateway.rpc.mapping.preview import picture_report, preview_status
from omniseer.gateway.v1.robot_gateway_pb2 import (
    ReportPictureRequest,
    ReportPictureResponse,
    RequestKeyFrameRequest,
    RequestKeyFrameResponse,
    SetPreviewModeRequest,
    SetPreviewModeResponse,
)


@dataclass(frozen=True, slots=True)
class PreviewService:
    """Control of the preview.

    Attributes:
        control: sets the desired state.
        feedback: speaks to the preview service for viewers.
        state: where the resulting status comes from, and viewers' reports go.
        recipients: finds out what a caller may see.
    """

    control: PreviewControl
    feedback: Feedback
    state: PictureSink
    recipients: Recipients

    async def set_preview_mode(
        self, request: SetPreviewModeRequest, call: CallContext
    ) -> SetPreviewModeResponse:
        """Returns when the preview has settled, or when the settle time or the caller's deadline ends."""
        profile = profile_from(request.profile) if request.enabled else None
        message = await self.control.set_mode(
            enabled=request.enabled,
            profile=profile,
            remaining_s=call.remaining_s(),
            camera=request.camera if request.enabled else "",
        )
        now = self.state.snapshot()
        preview = preview_status(now.preview, now.preview_measured, now.pictures, self.recipients.of(call))
        return SetPreviewModeResponse(accepted=True, message=message, preview=preview)

    async def request_key_frame(
        self, request: RequestKeyFrameRequest, _call: CallContext
    ) -> RequestKeyFrameResponse:
        """Returns when the preview service has the request."""
        newest_pts = request.newest_pts if request.HasField("newest_pts") else None
        forced = await self.feedback.request_key_frame(self.control.link.view, newest_pts)
        return RequestKeyFrameResponse(forced=forced)

    async def report_picture(self, request: ReportPictureRequest, call: CallContext) -> ReportPictureResponse:
        """Takes a viewer's report, and has the worst age of all passed on."""
        pictures = self.state.take_picture(call.caller, request.viewer_id, picture_report(request))
        if pictures.link_age_ms is not None:
            self.feedback.pass_on(pictures.link_age_ms)
        return ReportPictureResponse()
