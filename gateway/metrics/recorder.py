"""Metrics of recording."""

from collections.abc import Iterator
from dataclasses import dataclass

from prometheus_client.core import Metric

from gateway.links.recorder.incidents import Incidents
from gateway.links.recorder.link import RecorderLink
from gateway.metrics.families import counter, gauge, gauges
from gateway.rpc.responses.export_stream import ExportStream
from gateway.status.recording import RecorderState, RecorderView


@dataclass(frozen=True, slots=True)
class RecorderMetrics:
    """What counts recording."""

    link: RecorderLink
    incidents: Incidents
    exports: ExportStream


def of_recording(view: RecorderView, recorder: RecorderMetrics) -> Iterator[Metric]:
    """Yields the families."""
    states = {each.value: float(view.status.state is each) for each in RecorderState}
    yield gauges("recorder_state", "1 for the state it is in.", "state", states)
    failures = recorder.link.failures
    yield gauge("recorder_link_failures", "Failures in a row to connect to the recorder.", failures)
    yield gauge("exports", "Exports of recordings that run.", recorder.exports.open)
    yield counter("exported_bytes", "Bytes sent by exports.", recorder.exports.sent_bytes)
    unreported = "Faults that the recorder could not be given."
    yield counter("faults_unreported", unreported, recorder.incidents.expired)
    if view.report is None:
        return
    # Of the present process of the recorder, as far as they are counts.
    report = view.report.value
    status = report.status
    yield gauge("recording_bytes_per_second", "Written at present.", status.bytes_per_s)
    yield gauge("recording_room_bytes", "May still be written.", status.room_bytes)
    yield gauge("recordings", "Recordings on the disk.", status.recordings)
    if report.messages_lost is not None:
        lost = "Messages lost from what is recorded at present, as far as they were counted."
        yield counter("recording_messages_lost", lost, report.messages_lost)
    uncounted = "Gaps of unknown size in what is recorded at present."
    yield counter("recording_uncounted_gaps", uncounted, report.uncounted_gaps)
    ring = "Attempts to write the ring that failed in a row."
    yield gauge("recording_ring_failures", ring, report.ring_failures)
    dropped = "Messages dropped because the disk was too slow."
    yield counter("recording_messages_dropped", dropped, report.messages_dropped)
    yield gauge("recording_disk_free_bytes", "Free on its file system.", report.disk_free_bytes)
    yield gauge("recording_disk_size_bytes", "Size of its file system.", report.disk_size_bytes)
