"""Metrics of the connection to the fleet."""

from collections.abc import Iterator
from dataclasses import dataclass, fields

from prometheus_client.core import Metric

from gateway.links.bridge.copies import Copies
from gateway.links.bridge.link import BridgeLink
from gateway.metrics.families import counter, counters, gauge, gauges
from gateway.rpc.hub_requests import HubRequests
from gateway.status.cloud import CloudState, CloudView, NotTaken, Retries


@dataclass(frozen=True, slots=True)
class BridgeMetrics:
    """What counts the connection to the fleet.

    Attributes:
        copies: None where the robot is not set up for recording.
    """

    link: BridgeLink
    copies: Copies | None
    requests: HubRequests


def of_cloud(view: CloudView, now_s: float, bridge: BridgeMetrics) -> Iterator[Metric]:
    """Yields the families."""
    status = view.status(now_s)
    states = {each.value: float(status.state is each) for each in CloudState}
    yield gauges("cloud_state", "1 for the state of the connection to the fleet's hub.", "state", states)
    failures = bridge.link.failures
    yield gauge("bridge_link_failures", "Failures in a row to connect to the bridge.", failures)
    answered = {outcome.value: float(count) for outcome, count in bridge.requests.answered.items()}
    yield counters("hub_requests", "Requests of the fleet's hub, by their outcome.", "outcome", answered)
    if bridge.copies:
        waiting = "States of copies that the recorder does not have yet."
        yield gauge("copy_states_waiting", waiting, bridge.copies.waiting)
        dropped = "States of copies that were dropped because too many waited for the recorder."
        yield counter("copy_states_dropped", dropped, bridge.copies.dropped)
        failed = "Attempts at which the recorder did not take the state of a copy."
        yield counter("copy_state_failures", failed, bridge.copies.failures)
    if view.newest is None:
        return
    yield gauge("outbox_events", "Events that wait to be sent to the hub.", status.outbox_events)
    yield gauge("outbox_bytes", "Size of the outbox.", status.outbox_bytes)
    yield gauge("outbox_max_bytes", "Its limit.", status.outbox_max_bytes)
    yield counter("cloud_events_sent", "Events that the hub has acknowledged.", status.events_sent)
    dropped = "Events dropped because the outbox was full, or its disk refused or changed them."
    yield counter("cloud_events_dropped", dropped, status.events_dropped)
    not_taken = {field.name: float(getattr(view.newest.not_taken, field.name)) for field in fields(NotTaken)}
    refused = "What the bridge has not taken of all that the hub has sent, by why."
    yield counters("hub_messages_not_taken", refused, "why", not_taken)
    retries = {field.name: float(getattr(view.newest.retries, field.name)) for field in fields(Retries)}
    yield counters("bridge_retries", "What has failed in the bridge and is tried again.", "of", retries)
    if status.last_sent_age_ms is not None:
        age_s = status.last_sent_age_ms / 1000
        yield gauge("cloud_last_sent_age_seconds", "Age of the newest acknowledgement.", age_s)
    waiting = "Recordings that wait to be copied or are being copied."
    yield gauge("uploads_waiting", waiting, status.uploads_waiting)
    left_out = "Recordings that are to be copied and find no place in the full queue."
    yield gauge("uploads_left_out", left_out, status.uploads_left_out)
    yield gauge("upload_bytes_per_second", "Sent of a recording at present.", status.upload_bytes_per_s)
