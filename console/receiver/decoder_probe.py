"""Which hardware decoders this computer really has: each one is tried in a process of its own.

That an element exists says little: drivers refuse later, hang, crash, hold pictures back or paint them green.
So a decoder counts only after it decoded a clip rightly, without holding anything back.
"""

import json
import signal
import subprocess
import sys
from collections.abc import Iterable
from typing import Final

HARDWARE: Final = {
    "h264": ("vah264dec", "nvh264dec", "v4l2slh264dec", "v4l2h264dec"),
    "h265": ("vah265dec", "nvh265dec", "v4l2slh265dec", "v4l2h265dec"),
}
"""GStreamer's elements, the first choice first: VA-API, NVIDIA, V4L2 without and with a state of its own."""
TRIAL_WITHIN_S: Final = 6.0


def present(codec: str) -> list[str]:
    """The elements for a codec that are installed here, proven or not.

    Raises:
        UserError: GStreamer is not installed.
    """
    # Imported here so that a program without GStreamer fails only when it is asked for pictures.
    from common.gst import Gst  # noqa: PLC0415

    return [element for element in HARDWARE[codec] if Gst.ElementFactory.find(element)]


def first_proven(codec: str, elements: Iterable[str]) -> str | None:
    """The first of the elements that can be relied on; None when none can. Takes a trial's time for each."""
    return next((element for element in elements if not objection(element, codec)), None)


def objection(element: str, codec: str, within_s: float = TRIAL_WITHIN_S) -> str:
    """Why a decoder can't be relied on; empty when it can."""
    command = [sys.executable, "-m", "console.receiver.decoder_trial", element, codec]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=within_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"it hung: no result within {within_s:g} s"
    if done.returncode < 0:
        return f"it crashed when tried ({signal.Signals(-done.returncode).name})"
    try:
        return str(json.loads(done.stdout)["reason"])
    except (ValueError, KeyError, TypeError):
        return f"its trial ended with code {done.returncode} and without a result"
