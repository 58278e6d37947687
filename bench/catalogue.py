"""Every row that the benchmarks offer: with which others it is measured, by which module, and for how long.

`scripts/bench` measures a part at a time, each in a process of its own (running.py). The order is that of the
page.
"""

import importlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from bench.fleet_sizes import SIZES
from bench.rows import Row


@dataclass(frozen=True, slots=True)
class Part:
    """Rows that are measured together.

    Args:
        module: has `rows(ground, wanted)`, where its group is a package; else it is the group.
        minutes: how long all of them take, about.
        names: of the rows; their first part is the group.
    """

    module: str
    minutes: float
    names: tuple[str, ...]

    @property
    def group(self) -> str:
        """Name of its group; `bench.GROUP` has `run(names)`, which returns the rows."""
        return self.names[0].partition(".")[0]


_LINKS: Final = ("lossy", "very_lossy", "far")
_AGES: Final = ("", "_ms", "_p95_ms", "_delivered_percent", "_torn")
_OVER_NARROW: Final = (
    "_p95_ms",
    "_worst_ms",
    "_freeze_ms",
    "_torn",
    "_fixed_worst_ms",
    "_fixed_freeze_ms",
    "_fixed_torn",
)
_CELLS: Final = tuple(
    f"video.excess_{sender}_sender_{receiver}_receiver_{figure}"
    for sender in ("reference", "ours")
    for receiver in ("plain", "ours")
    for figure in ("ms", "p99_ms", "delivered_percent")
)
_PEERS: Final = tuple(
    f"video.peer_{peer}_{figure}"
    for peer in ("ours", "rtp", "webrtc")
    for figure in ("ms", "p99_ms", "delivered_percent")
)
_ADAPTIVE: Final = tuple(
    f"video.adaptive_{link}{figure}"
    for link in ("limited", "lossy")
    for figure in ("", "_freeze_ms", "_frame_kbit")
)
_DARK: Final = tuple(
    f"video.dark_ms_{failure}"
    for failure in (
        "error",
        "no_output",
        "empty",
        "hang",
        "crash",
        "profile_change",
        "key_frame",
        "bit_rate",
    )
)
_STOPS: Final = tuple(
    f"drive.stop_{fault}_ms"
    for fault in (
        "release",
        "client_killed",
        "client_frozen",
        "cable_cut",
        "lanes_silent",
        "downlink",
        "gateway_killed",
        "gateway_frozen",
        "worker_killed",
        "worker_frozen",
        "viewer",
        "viewer_lossy",
    )
)
_BRIDGE: Final = tuple(
    f"fleet.bridge{uploads}_{figure}"
    for uploads in ("", "_without_uploads")
    for figure in ("cpu", "mib", "cpu_against_bare", "mib_against_bare")
)
_HUB_SIZES: Final = tuple(f"fleet.hub_{robots}_{figure}" for robots in SIZES for figure in ("cpu", "mib"))

PARTS: Final = (
    Part("bench.ros", 6, ("ros.intake", "ros.intake_newest", "ros.flat")),
    Part("bench.ros", 1, ("ros.gateway_cpu",)),
    Part("bench.ros", 3, ("ros.value_latency_ms",)),
    Part("bench.status", 1, ("status.throughput", "status.cpu_per_call")),
    Part("bench.status", 1, ("status.tls",)),
    Part("bench.status", 2, ("status.p99",)),
    Part("bench.status", 3, ("status.cpu_per_call_real",)),
    Part("bench.watch", 2, ("watch.cpu_100", "watch.served_100")),
    Part("bench.watch", 2, ("watch.p99_healthy",)),
    Part("bench.events", 1, ("events.p99_ms",)),
    Part("bench.idle", 4, ("idle.cpu", "idle.rss_mib", "idle.cpu_after", "idle.rss_after_mib")),
    Part("bench.cli", 1, ("cli.start_ms", "cli.status_ms")),
    Part("bench.video.latency", 5, _CELLS),
    Part(
        "bench.video.joining",
        6,
        ("video.first_frame", "video.first_frame_ms", "video.first_frame_srt_ms"),
    ),
    Part("bench.video.joining_together", 1, ("video.first_frame_ten_ms", "video.first_frame_ten_key_frames")),
    Part("bench.video.enabling", 2, ("video.enable_to_frame_ms", "video.cold_enable_ms")),
    Part("bench.video.cpu", 5, ("video.cpu", "video.cpu_in_turns")),
    Part("bench.video.switching", 1, ("video.switch_gap_ms",)),
    Part("bench.video.camera_switching", 2, ("video.camera_switch_gap_ms", "video.camera_against_profile")),
    Part("bench.video.adaptive", 12, _ADAPTIVE),
    Part("bench.video.dark", 9, _DARK),
    Part(
        "bench.video.age_default",
        3,
        ("video.age_default", "video.age_default_ms", "video.age_default_p99_ms", "video.age_error_ms"),
    ),
    Part("bench.video.sixty_fps", 2, ("video.age_60_ms", "video.age_60_delivered_percent")),
    Part("bench.video.receiver_cpu", 2, ("video.receiver_cpu",)),
    Part("bench.video.ros_camera", 2, ("video.ros_camera_cpu",)),
    Part(
        "bench.video.age_lossy", 6, tuple(f"video.age_{link}{figure}" for link in _LINKS for figure in _AGES)
    ),
    Part("bench.video.age_narrow", 3, tuple(f"video.age_narrow{figure}" for figure in _OVER_NARROW)),
    Part("bench.video.age_narrow", 3, tuple(f"video.age_deep{figure}" for figure in _OVER_NARROW)),
    Part("bench.video.age_narrow", 3, ("video.age_changing_freeze_ms", "video.age_changing_reconnects")),
    Part("bench.video.viewer_cpu", 3, ("video.viewer_cpu",)),
    Part("bench.video.h265", 1, ("video.excess_h265_ms", "video.excess_h265_delivered_percent")),
    Part("bench.video.peers", 4, _PEERS),
    Part("bench.viewer", 1, ("viewer.extra_latency_frames",)),
    Part("bench.monitor", 1, ("monitor.loop_delay_p99_ms",)),
    Part("bench.monitor", 1, ("monitor.loop_delay_p99_full_ms",)),
    Part("bench.drive.stopping", 23, _STOPS),
    Part("bench.drive.picture", 4, ("drive.stop_camera_ms", "drive.stop_preview_ms", "drive.stop_screen_ms")),
    Part("bench.drive.revoking", 2, ("drive.stop_revoked_ms",)),
    Part("bench.drive.thawing", 2, ("drive.thawed_ms",)),
    Part("bench.drive.cpu", 2, ("drive.cpu", "drive.cpu_idle")),
    Part(
        "bench.drive.losses",
        21,
        ("drive.false_stops", "drive.false_stops_one_lane", "drive.command_p99_ms"),
    ),
    Part("bench.drive.losses", 11, ("drive.false_stops_very_lossy",)),
    Part("bench.rec.losing", 6, ("rec.lost_10", "rec.lost_10_miscounted")),
    Part("bench.rec.losing", 6, ("rec.lost_40", "rec.lost_40_miscounted")),
    Part("bench.rec.losing", 2, ("rec.lost_stalled_miscounted",)),
    Part("bench.rec.cpu", 5, ("rec.cpu", "rec.idle_cpu", "rec.ring_cpu")),
    Part("bench.rec.video", 4, ("rec.preview_tap", "rec.stamps", "rec.stamps_worst")),
    Part("bench.rec.killing", 2, ("rec.kill_loss_ms",)),
    Part("bench.rec.recovering", 1, ("rec.recovery_mib_s",)),
    Part("bench.rec.snapshots", 3, ("rec.snapshot_ms", "rec.snapshot_disk")),
    Part("bench.export.throughput", 1, ("export.throughput",)),
    Part("bench.export.resuming", 2, ("export.resume_kib",)),
    Part("bench.export.status", 2, ("export.status_p99", "export.status_p99_unlimited")),
    Part("bench.fleet.failures", 6, ("fleet.lost", "fleet.duplicates", "fleet.disordered", "fleet.gap_s")),
    Part("bench.fleet.rates", 2, ("fleet.events_s", "fleet.batched_events_s")),
    Part(
        "bench.fleet.cost",
        5,
        (
            "fleet.robot_kib",
            "fleet.state_cpu_us",
            "fleet.state_cpu_100_us",
            "fleet.event_disk_bytes",
            *_HUB_SIZES,
        ),
    ),
    Part("bench.fleet.bridge", 11, _BRIDGE),
    Part("bench.fleet.uploading", 3, ("fleet.upload_resume_mib",)),
    Part(
        "bench.siege",
        6,
        (
            "siege.answered",
            "siege.p99",
            "siege.p99_beside",
            "siege.login_ms",
            "siege.unknown_login_ms",
            "siege.revocation_s",
            "siege.rss_mib",
            "siege.descriptors",
            "siege.closed",
        ),
    ),
    Part("bench.soak.programs", 31, ("soak.rss_growth_mib", "soak.fds_growth")),
    Part("bench.soak.programs", 31, ("soak.gateway_rss_growth_mib", "soak.gateway_fds_growth")),
    Part(
        "bench.soak.robot",
        122,
        tuple(
            f"soak.robot_{figure}"
            for figure in ("rss_growth_mib", "fds_growth", "threads_growth", "log_growth", "failed_rounds")
        ),
    ),
)

ON_REQUEST: Final = ("drive", "rec", "export", "fleet", "siege", "soak")
"""Groups that are too long, or too hard on the machine, to be part of a run without names."""

GROUPS: Final = tuple(dict.fromkeys(part.group for part in PARTS))
NAMES: Final = tuple(name for part in PARTS for name in part.names)


def chosen(words: Collection[str]) -> Mapping[Part, tuple[str, ...]]:
    """Returns the rows that words name, by part, in the order of the catalogue.

    Args:
        words: groups and rows; none for all groups but those ON_REQUEST.

    Raises:
        ValueError: one is neither.
    """
    for word in words:
        if word not in GROUPS and word not in NAMES:
            raise ValueError(f"unknown benchmark '{word}': {_nearest(word)}")
    wanted = set(words) or set(GROUPS) - set(ON_REQUEST)
    found = {
        part: tuple(name for name in part.names if part.group in wanted or name in wanted) for part in PARTS
    }
    return {part: names for part, names in found.items() if names}


def rows_of(names: Collection[str], ground: Any) -> list[Row]:
    """Returns the rows of a group that is a package.

    Args:
        names: of the rows.
        ground: what the group's modules measure on.
    """
    return [
        row
        for part in PARTS
        if (wanted := set(names) & set(part.names))
        for row in importlib.import_module(part.module).rows(ground, wanted)
        if row.name in wanted
    ]


def _nearest(word: str) -> str:
    group = word.partition(".")[0]
    if group not in GROUPS:
        return f"groups are {', '.join(GROUPS)}"
    return f"rows are {', '.join(name for name in NAMES if name.startswith(f'{group}.'))}"
