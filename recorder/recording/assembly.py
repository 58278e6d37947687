"""The parts that a recorder consists of, assembled."""

from dataclasses import dataclass

from recorder.config import RecorderSettings
from recorder.recording.lifecycle_runner import LifecycleRunner
from recorder.recording.manual_recorder import ManualRecorder
from recorder.recording.outputs import Outputs, Sources
from recorder.recording.reports import Reports
from recorder.recording.ring_recorder import RingRecorder
from recorder.recording.snapshots import Snapshots
from recorder.store.catalogue import Catalogue
from recorder.store.housekeeping import Housekeeping
from recorder.store.outages import Outages
from recorder.store.ring import Ring
from recorder.store.room import Reserve
from recorder.store.state_file import StateFile
from recorder.writing.queue import SampleQueue
from recorder.writing.writer import Latched, Writer


@dataclass(frozen=True, slots=True)
class Parts:
    """What the recorder, its operations and its status reader share. `ring` is None if none is configured."""

    settings: RecorderSettings
    boot_id: str
    run_id: str
    queue: SampleQueue
    sources: Sources
    lifecycle: LifecycleRunner
    catalogue: Catalogue
    state_file: StateFile
    reserve: Reserve
    housekeeping: Housekeeping
    reports: Reports
    writer: Writer
    outputs: Outputs
    manual: ManualRecorder
    segments: Ring | None
    ring: RingRecorder | None


def build(
    settings: RecorderSettings,
    queue: SampleQueue,
    sources: Sources,
    latched: Latched,
    *,
    boot_id: str,
    run_id: str,
) -> Parts:
    """Returns the parts, for the event loop that runs; nothing is read or started yet.

    Args:
        settings: of the program.
        queue: what `sources` fill.
        sources: what takes messages.
        latched: what the head of each segment repeats.
        boot_id: of the computer; empty if unknown.
        run_id: random for every process.
    """
    lifecycle, outputs, reports = LifecycleRunner(), Outputs(sources), Reports()
    catalogue = Catalogue(settings.root)
    state_file = StateFile(settings.root, boot_id)
    reserve = Reserve(settings.root)
    writer = Writer(queue, latched, reports.failed)
    segments = Ring(settings.ring_directory, settings.ring.seconds) if settings.ring.preset else None
    housekeeping = Housekeeping(settings, catalogue, segments)
    manual = ManualRecorder(
        settings,
        lifecycle,
        catalogue,
        outputs,
        writer,
        sources=sources,
        state_file=state_file,
        reserve=reserve,
        boot_id=boot_id,
    )
    ring: RingRecorder | None = None
    if segments:
        outages = Outages()
        snapshots = Snapshots(
            settings,
            segments,
            catalogue,
            outputs,
            outages,
            housekeeping=housekeeping,
            boot_id=boot_id,
            run_id=run_id,
        )
        ring = RingRecorder(settings, segments, outputs, writer, outages=outages, snapshots=snapshots)
    return Parts(
        settings=settings,
        boot_id=boot_id,
        run_id=run_id,
        queue=queue,
        sources=sources,
        lifecycle=lifecycle,
        catalogue=catalogue,
        state_file=state_file,
        reserve=reserve,
        housekeeping=housekeeping,
        reports=reports,
        writer=writer,
        outputs=outputs,
        manual=manual,
        segments=segments,
        ring=ring,
    )
