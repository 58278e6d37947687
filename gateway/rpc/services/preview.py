"""The live preview: switched on and off."""

from dataclasses import dataclass

from gateway.links.preview.control import PreviewControl
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.ports import SnapshotSource
from gateway.rpc.calls.recipient import Recipients
from gateway.rpc.mapping.enums import profile_from
from gateway.rpc.mapping.preview import preview_status
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest, SetPreviewModeResponse


@dataclass(frozen=True, slots=True)
class PreviewService:
    """Control of the preview.

    Attributes:
        control: sets the desired state.
        state: where the resulting status comes from.
        recipients: finds out what a caller may see.
    """

    control: PreviewControl
    state: SnapshotSource
    recipients: Recipients

    async def set_preview_mode(
        self, request: SetPreviewModeRequest, call: CallContext
    ) -> SetPreviewModeResponse:
        """Returns when the preview has settled, or when the settle time or the caller's deadline ends."""
        profile = profile_from(request.profile) if request.enabled else None
        message = await self.control.set_mode(
            enabled=request.enabled, profile=profile, remaining_s=call.remaining_s()
        )
        now = self.state.snapshot()
        preview = preview_status(now.preview, now.preview_measured, self.recipients.of(call))
        return SetPreviewModeResponse(accepted=True, message=message, preview=preview)
