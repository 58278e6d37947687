"""Viewers behind a link that loses packets, SRT's own control packets among them."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.support.mpegts import analyse
from tests.support.recording import record
from tests.support.running_preview import RunningPreview
from tests.support.udp_link import Impairment, UdpLink
from tests.support.undisturbed import without_stall
from tests.support.watcher import Watcher

pytestmark = pytest.mark.gst

FPS = 30
SECONDS = 6
DELAY_S = 0.015
ROUND_TRIP_MS = 60
LATENCY_MS = 500
"""Of the service, for losses that a viewer with 20 ms of its own could not make up for on this link."""


@pytest.mark.timeout(300)
def test_what_is_lost_is_sent_again_although_control_packets_are_lost(tmp_path: Path) -> None:
    # What a stall makes later than the latency is lost for good, as it is to be.
    without_stall(what_is_lost_is_sent_again, tmp_path)


def what_is_lost_is_sent_again(directory: Path) -> None:
    with (
        RunningPreview(directory, {"srt": {"latency_ms": LATENCY_MS}}) as preview,
        UdpLink(preview.port, Impairment(delay_s=DELAY_S)) as link,
        ThreadPoolExecutor(1) as viewer,
    ):
        preview.enable()
        preview.running()
        recording = viewer.submit(record, link.port, SECONDS)
        # SRT begins with a round trip of 100 ms, and repeats a lost loss report too late for that time.
        preview.wait_for(lambda a: 0 < a.measurement.worst_rtt_ms < ROUND_TRIP_MS, "a measured round trip")
        link.impairment.loss, link.impairment.control_loss = 0.03, 0.1
        preview.wait_for(lambda a: a.measurement.worst_loss_percent > 0, "losses")
        stream = analyse(recording.result())
        actual = preview.running()
    assert stream.counter_gaps == []
    assert len(stream.access_units) > 0.95 * SECONDS * FPS
    assert actual.counters.faults == 0


def test_viewers_join_and_stay_while_control_packets_are_lost(preview: RunningPreview) -> None:
    preview.enable()
    preview.running()
    with UdpLink(preview.port, Impairment(control_loss=0.1)) as link:
        for _ in range(5):
            with Watcher(link.port, max_age_s=10.0) as watcher:
                watcher.wait_for_frames(FPS)
                assert watcher.lost == []
    assert preview.running().counters.faults == 0
