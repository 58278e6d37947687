"""A publisher of numbered messages in the domain of the environment, which knows when each was sent."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from tests.support.talker import talking

_PERIOD_S = 0.002


@dataclass
class Publishing:
    """Publishes messages whose `data` counts from 1 on."""

    publisher: Any
    message_type: Any
    sent: int = 0
    sent_at_s: dict[int, float] = field(default_factory=dict)

    @property
    def heard(self) -> bool:
        """Whether the topic has a subscriber."""
        return bool(self.publisher.get_subscription_count())

    def publish(self, count: int) -> None:
        """Publishes so many, 500 a second."""
        for _ in range(count):
            self.sent += 1
            self.sent_at_s[self.sent] = time.time()
            self.publisher.publish(self.message_type(data=self.sent))
            time.sleep(_PERIOD_S)

    def publish_for(self, seconds: float) -> None:
        """Publishes for so long."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.publish(1)


@contextmanager
def publishing(topic: str, message_type: Any) -> Iterator[Publishing]:
    """Reliable, and with a history that outlasts a busy machine."""
    with talking("publishing") as talker:
        yield Publishing(talker.publisher(topic, message_type, depth=1000), message_type)
