"""The preview against the usual pipeline: same camera, same codec, in the same run.

Where "what" does not say "at once", each side is alone on the machine, and both in every round. Frames carry
the moment of their capture (stamp.py) from before the encoder to behind the decoder.
"""

import importlib
import tempfile
from pathlib import Path

from bench.rows import Row

_MODULES = {
    "bench.video.latency": tuple(
        f"video.excess_{sender}_sender_{receiver}_receiver_{figure}"
        for sender in ("reference", "ours")
        for receiver in ("plain", "ours")
        for figure in ("ms", "p99_ms", "delivered_percent")
    ),
    "bench.video.joining": ("video.first_frame", "video.first_frame_ms"),
    "bench.video.joining_together": ("video.first_frame_ten_ms",),
    "bench.video.enabling": ("video.enable_to_frame_ms", "video.cold_enable_ms"),
    "bench.video.cpu": ("video.cpu", "video.cpu_in_turns"),
    "bench.video.switching": ("video.switch_gap_ms",),
    "bench.video.camera_switching": ("video.camera_switch_gap_ms", "video.camera_against_profile"),
    "bench.video.adaptive": tuple(
        f"video.adaptive_{link}{figure}"
        for link in ("limited", "lossy")
        for figure in ("", "_freeze_ms", "_frame_kbit")
    ),
    "bench.video.dark": tuple(
        f"video.dark_ms_{failure}"
        for failure in ("error", "no_output", "empty", "hang", "crash", "profile_change", "key_frame")
    ),
    "bench.video.age_default": (
        "video.age_default",
        "video.age_default_ms",
        "video.age_default_p99_ms",
        "video.age_error_ms",
    ),
    "bench.video.sixty_fps": ("video.age_60_ms", "video.age_60_delivered_percent"),
    "bench.video.receiver_cpu": ("video.receiver_cpu",),
    "bench.video.ros_camera": ("video.ros_camera_cpu",),
    "bench.video.age_lossy": tuple(
        f"video.age_{link}{figure}"
        for link in ("lossy", "very_lossy", "far")
        for figure in ("", "_ms", "_p95_ms", "_delivered_percent", "_torn")
    ),
    "bench.video.age_narrow": (
        "video.age_narrow_p95_ms",
        "video.age_narrow_worst_ms",
        "video.age_narrow_torn",
        "video.age_narrow_fixed_worst_ms",
        "video.age_narrow_fixed_torn",
        "video.age_changing_freeze_ms",
        "video.age_changing_reconnects",
    ),
    "bench.video.viewer_cpu": ("video.viewer_cpu",),
    "bench.video.h265": ("video.excess_h265_ms",),
    "bench.video.peers": ("video.peer_rtp_ms", "video.peer_webrtc_ms"),
}
"""Each has `rows(workdir, wanted)`, which measures the wanted ones of its rows."""


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    # The camera's frames and its shared memory: in RAM where there is a place for it.
    in_ram = Path("/dev/shm")  # noqa: S108  # a new directory below it, mode 0700
    with tempfile.TemporaryDirectory(dir=in_ram if in_ram.is_dir() else None) as workdir:
        for module, offered in _MODULES.items():
            wanted = {name for name in offered if not names or name in names}
            if wanted:
                rows += importlib.import_module(module).rows(Path(workdir), wanted)
    return rows
