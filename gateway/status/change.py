"""Change detection: what wakes the clients that watch the status.

A source counts unless its spec excludes it. Each field of the snapshot has a projection here or is named in
EXCLUDED, which a test checks.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from operator import attrgetter
from typing import Any, Final

from gateway.status.cloud import CloudView
from gateway.status.fault import Fault
from gateway.status.freshness import Sample
from gateway.status.preview import PreviewView
from gateway.status.recording import RecorderView
from gateway.status.snapshot import Snapshot
from gateway.status.source_view import SourceView
from gateway.status.sources import SourceSpec
from gateway.status.teleop import TeleopView

EXCLUDED: Final = frozenset({"at_s", "gateway", "events", "access", "ros_stalled"})
"""Time; counters that the watchers' own calls advance; events, which have their own stream; the access state
and the ROS sampler's, whose problems are faults."""


def change_key(snapshot: Snapshot) -> tuple[Any, ...]:
    """Returns a key that differs between two snapshots when an operator would act on the difference.

    It holds no ages: they grow by themselves.
    """
    return tuple([project(getattr(snapshot, field)) for field, project in PROJECTIONS.items()])


def _whole(value: object) -> object:
    return value


def _value_and_staleness(sample: Sample[Any]) -> tuple[Any, bool]:
    return sample.value, sample.freshness.stale


def _samples(samples: Mapping[SourceSpec[Any], Sample[Any]]) -> object:
    return [(each.value, each.freshness.stale) for spec, each in samples.items() if spec.in_change_key]


def _sources(sources: tuple[SourceView, ...]) -> object:
    return [(each.spec, each.state, each.freshness.stale, each.detail) for each in sources]


def _teleop(view: TeleopView | None) -> object:
    """Without velocities and ages, which change all the time: the driver has a stream of its own."""
    if view is None:
        return None
    drive = view.drive
    return drive.enabled, drive.error, drive.phase, drive.stop, view.inhibits, view.holder, view.last_error


def _recorder(view: RecorderView | None) -> object:
    """Without what grows while it records: elapsed time, sizes, counts of messages, room."""
    if view is None:
        return None
    status = view.status
    return (
        status.state,
        status.recording_id,
        status.label,
        status.preset,
        status.messages_lost,
        status.uncounted_gaps,
        status.video,
        status.snapshots_pending,
        status.recordings,
        status.to_copy,
        status.last_error,
        [(each.name, each.in_ring) for each in status.presets],
    )


def _cloud(view: CloudView | None) -> object:
    """Without what grows while it works: ages, sizes, counts of events and bytes."""
    if view is None:
        return None
    report = view.newest
    if report is None:
        return view.error
    status = report.status
    return (
        status.state,
        status.robot,
        status.fleet,
        status.uploads_waiting,
        status.uploading_id,
        status.uploading.state if status.uploading else None,
        status.uploads_paused,
        status.uploads_left_out,
        status.last_error,
    )


def _faults(faults: tuple[Fault, ...]) -> object:
    return [(each.condition, each.onset_s, each.cleared_s) for each in faults]


PROJECTIONS: Final[Mapping[str, Callable[[Any], object]]] = {
    "identity": _whole,
    "health": _whole,
    "samples": _samples,
    "command": _value_and_staleness,
    # The measurement is the next field: its time of reception is no change.
    "preview": attrgetter(*(field.name for field in fields(PreviewView) if field.name != "measured")),
    "preview_measured": _value_and_staleness,
    # The age is no change, as no age is.
    "pictures": attrgetter("viewer_count"),
    "sources": _sources,
    "teleop": _teleop,
    "recorder": _recorder,
    "cloud": _cloud,
    "faults": _faults,
}
