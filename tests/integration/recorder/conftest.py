"""The intake with everything that the graph offers, in a ROS domain of the test's own."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from recorder.intake.intake import Intake, intake
from recorder.intake.topics import Selects  # noqa: TC001
from recorder.values import Channel, Item, Loss, Sample
from tests.support.talker import talker

__all__ = ["taken", "talker"]


class Everything:
    """A preset."""

    def selects(self, topic: str) -> bool:
        return topic != "/parameter_events"


class Nothing:
    """A preset."""

    def selects(self, _topic: str) -> bool:
        return False


@dataclass
class Taken:
    """What the intake has handed over."""

    intake: Intake
    items: list[Item] = field(default_factory=list)

    def samples(self, topic: str) -> list[Sample]:
        return [each for each in list(self.items) if isinstance(each, Sample) and each.channel.topic == topic]

    def lost(self, topic: str) -> int:
        return sum(
            each.messages or 0
            for each in list(self.items)
            if isinstance(each, Loss) and each.channel and each.channel.topic == topic
        )

    def channels(self, topic: str) -> list[Channel]:
        return list(dict.fromkeys(each.channel for each in self.samples(topic)))


@pytest.fixture
def taken(ros_domain: int) -> Iterator[Taken]:  # noqa: ARG001  # for its effect
    items: list[Item] = []
    presets: dict[str, Selects] = {"everything": Everything(), "nothing": Nothing()}
    with intake(presets, items.extend) as running:
        running.want(frozenset({"everything"}))
        yield Taken(running, items)
