"""What is, as the preview service told it last."""

from dataclasses import dataclass

from gateway.status.preview import (
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    Profile,
    Stream,
)


@dataclass(frozen=True, slots=True)
class Actual:
    """One message of the service. `counters` began at 0 with the process that `instance_id` names."""

    instance_id: str
    applied_revision: int
    state: PreviewState
    profile: Profile | None
    last_error: str
    listener: Listener | None
    stream: Stream | None
    encoder: Encoder | None
    measurement: Measurement | None
    counters: Counters
