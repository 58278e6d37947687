"""Trial of an encoder: whether it really encodes on this machine.

The existence of an element proves little: drivers refuse later, return nothing, return empty buffers, crash
or hang. So an encoder counts as proven only after it has encoded frames, in a process of its own
(probe_child.py) with a deadline.
"""

from common import trial
from common.gst import Gst
from preview.encoders.catalogue import Encoder
from preview.encoders.probe import Verdict
from preview.state.values import Target


async def attempt(target: Target, timeout_s: float, encoder: Encoder) -> Verdict:
    """Tries an encoder.

    Args:
        target: stream parameters.
        timeout_s: deadline, start of the process included.
        encoder: entry of the catalogue.

    Raises:
        trial.TrialError: its element exists, but does not encode.
    """
    if Gst.ElementFactory.find(encoder.element) is None:
        reason = f"there is no GStreamer element {encoder.element}"
        return Verdict(present=False, proven=False, reason=reason)
    figures = map(str, (target.width_px, target.height_px, target.fps, target.bitrate_kbps))
    result = await trial.run(timeout_s, "preview.encoders.probe_child", encoder.name, *figures)
    return Verdict(present=True, proven=True, first_byte_ms=float(result["first_byte_ms"]))
