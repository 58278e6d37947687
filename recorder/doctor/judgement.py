"""From facts to findings: what is wrong, why it matters, what to do. Pure."""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Final

from common.findings import Finding, good, note, wrong
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from recorder.config import RecorderSettings

_MIB: Final = 1024 * 1024
_MOST_NAMED: Final = 8


def folder_findings(settings: RecorderSettings, room_bytes: int, *, writable: bool) -> Iterator[Finding]:
    """Yields what the folder of recordings shows."""
    root = settings.root
    if not writable:
        yield wrong(
            "disk.folder",
            f"{root} can't be written by this user",
            "Nothing can be recorded",
            "Make it a directory of the recorder's user, or set root",
        )
    elif room_bytes <= 0:
        yield wrong(
            "disk.room",
            f"{root} has no room: {-room_bytes // _MIB} MiB too much are in use",
            "Old recordings are deleted for new ones; when none may be deleted, recording stops",
            "Copy recordings and delete them, or change room.quota_bytes or room.min_free_bytes",
        )
    else:
        yield good("disk.room", f"{root} has room for {room_bytes // _MIB} MiB")
    if settings.ring.preset is None:
        yield note(
            "ring",
            "there is no ring",
            "Snapshots and incidents are impossible: what was before a fault is lost",
            "Set ring.preset to one of the presets",
        )
    else:
        yield good("ring", f"the ring keeps {settings.ring.seconds} s of {settings.ring.preset}")


def bundle_findings(folder: Path, problem: str, hidden_below: Path | None) -> Iterator[Finding]:
    """Yields whether a folder of the robot's own experiments can be read.

    Args:
        folder: one of `run_bundles`.
        problem: why it can't be read; empty if it can.
        hidden_below: the folder around it that the recorder's unit hides; None if it hides none.
    """
    unlisted = "The experiments in it are neither listed nor exported"
    if problem:
        yield wrong(
            "run_bundles",
            f"{folder} can't be read: {problem}",
            unlisted,
            "Let the recorder's user read it, where the recorder runs: a container needs a mount, and a "
            "systemd unit sees nothing below /home (docs/recording.md)",
        )
    elif hidden_below:
        yield note(
            "run_bundles",
            f"{folder} can be read, but robot-recorder.service sees nothing below {hidden_below}",
            f"{unlisted}, unless the unit was changed",
            "Move it, to /srv/runs for example, set run_bundles to that, and type: "
            "sudo systemctl restart robot-recorder",
        )
    else:
        yield good("run_bundles", f"{folder} can be read")


def program_findings(state: recorder_pb.WatchStateResponse) -> Iterator[Finding]:
    """Yields what the running program says of itself."""
    status = state.status
    name = pb.RecorderState.Name(status.state).removeprefix("RECORDER_STATE_").lower()
    if status.last_error:
        yield wrong(
            "recorder", f"robot-recorder is {name}: {status.last_error}", "It can't record", "See above"
        )
    else:
        yield good("recorder", f"robot-recorder runs; it is {name}")
    if state.messages_dropped:
        yield note(
            "recorder.queue",
            f"{state.messages_dropped} messages were dropped because the disk was too slow",
            "They are missing from recordings, which say so",
            "Record less, or on a faster disk; queue_bytes bridges short delays",
        )
    if state.messages_lost:
        yield note(
            "recorder.lost",
            f"{state.messages_lost} messages were lost before the recorder could take them",
            "They are missing from recordings, which say so",
            "Let their publishers offer reliable QoS, or a longer history",
        )
    if state.uncounted_gaps:
        yield note(
            "recorder.gaps",
            f"what is recorded has gaps of unknown size, {state.uncounted_gaps} so far",
            "Messages are missing, and nothing says how many",
            "Their causes and times: robotctl record show ID",
        )


def preset_findings(
    settings: RecorderSettings, topics: Collection[str], problems: Mapping[str, str]
) -> Iterator[Finding]:
    """Yields which topics of the graph each preset records, and what can't be recorded.

    Args:
        settings: of the program.
        topics: those that can be recorded.
        problems: by topic, why it can't; "" is the graph as a whole.
    """
    for name, preset in settings.presets.items():
        chosen = sorted(topic for topic in topics if preset.selects(topic))
        more = f" and {len(chosen) - _MOST_NAMED} more" if len(chosen) > _MOST_NAMED else ""
        if chosen:
            yield good(f"preset.{name}", f"{', '.join(chosen[:_MOST_NAMED])}{more}")
        else:
            yield note(
                f"preset.{name}",
                f"no topic of the graph is one of preset {name}",
                "A recording of it is empty but for the video",
                "Compare its topics with: ros2 topic list",
            )
    for topic, text in problems.items():
        yield wrong(
            f"topic{topic}",
            text,
            "Its messages are missing from recordings",
            "Install its package where the recorder runs, or exclude the topic from the presets",
        )
