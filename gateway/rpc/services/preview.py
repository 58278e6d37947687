"""The live preview: switched on and off."""

from gateway.links.preview.control import PreviewControl
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.ports import SnapshotSource
from gateway.rpc.calls.recipient import Recipients
from gateway.rpc.mapping.enums import profile_from
from gateway.rpc.mapping.preview import preview_status
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest, SetPreviewModeResponse


class PreviewService:
    """Control of the preview.

    Args:
        control: sets the desired state.
        state: where the resulting status comes from.
        recipients: finds out what a caller may see.
    """

    def __init__(self, control: PreviewControl, state: SnapshotSource, recipients: Recipients) -> None:
        self._control = control
        self._state = state
        self._recipients = recipients

    async def set_preview_mode(
        self, request: SetPreviewModeRequest, call: CallContext
    ) -> SetPreviewModeResponse:
        """Returns when the preview has settled, or when the settle time or the caller's deadline ends."""
        profile = profile_from(request.profile) if request.enabled else None
        message = await self._control.set_mode(
            enabled=request.enabled, profile=profile, remaining_s=call.remaining_s()
        )
        now = self._state.snapshot()
        preview = preview_status(now.preview, now.preview_measured, self._recipients.of(call))
        return SetPreviewModeResponse(accepted=True, message=message, preview=preview)
