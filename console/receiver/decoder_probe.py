"""Proves hardware decoders: each candidate decodes a clip in a process of its own.

That an element exists says little: drivers refuse later, hang, crash, hold frames back or paint them green.
So a decoder counts only after it decoded a clip correctly, without holding anything back.
"""

import asyncio
from typing import Final

from common import trial

HARDWARE: Final = {
    "h264": ("vah264dec", "nvh264dec", "v4l2slh264dec", "v4l2h264dec"),
    "h265": ("vah265dec", "nvh265dec", "v4l2slh265dec", "v4l2h265dec"),
}
"""GStreamer's elements, the first choice first: VA-API, NVIDIA, V4L2 stateless and V4L2 stateful."""
TRIAL_TIMEOUT_S: Final = 6.0


def proven_decoder(codec: str) -> str | None:
    """Returns the first installed hardware decoder that passes its trial; None if there is none.

    Takes up to TRIAL_TIMEOUT_S for each installed candidate.

    Raises:
        UserError: GStreamer is not installed.
    """
    # Imported here so that a program without GStreamer fails only when it decodes.
    from common.gst import Gst  # noqa: PLC0415

    installed = (element for element in HARDWARE[codec] if Gst.ElementFactory.find(element))
    return next((element for element in installed if not objection(element, codec)), None)


def objection(element: str, codec: str, timeout_s: float = TRIAL_TIMEOUT_S) -> str:
    """Returns why a decoder fails its trial; empty if it passes."""
    try:
        asyncio.run(trial.run(timeout_s, "console.receiver.decoder_trial", element, codec))
    except trial.TrialError as error:
        return str(error)
    return ""
