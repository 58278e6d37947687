"""The outbox against a model: what leaves it is what came, with gaps for what was dropped."""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from bridge.events.values import Batch, DropReason, Event, Gap, Item, Position
from bridge.outbox.database import Database


@dataclass
class Place:
    """One sequence of a run, as the model keeps it. 0 stands for an earlier run's missing events."""

    run_id: str
    sequence: int
    severity: int
    there: bool = True


class OutboxMachine(RuleBasedStateMachine):
    """Adds, drops, begins and ends batches, crashes; the hub takes each batch once."""

    @initialize()
    def begin(self) -> None:
        self.directory = Path(tempfile.mkdtemp(prefix="outbox-model-"))
        self.database = Database(self.directory, 64 * 1024 * 1024)
        self.run, self.sequence = 1, 0
        self.waiting: list[Place] = []
        self.flight = 0
        self.batch: Batch | None = None
        self.hub: dict[tuple[str, int], Batch] = {}
        self.expected: list[Place] = []
        self.dropped = 0

    def teardown(self) -> None:
        if hasattr(self, "database"):
            self.database.close()
            shutil.rmtree(self.directory)

    @property
    def run_id(self) -> str:
        return f"run-{self.run}"

    @rule(severities=st.lists(st.integers(1, 3), min_size=1, max_size=80))
    def add_events(self, severities: list[int]) -> None:
        items: list[Item] = []
        for severity in severities:
            self.sequence += 1
            self.waiting.append(Place(self.run_id, self.sequence, severity))
            items.append(Event(self.run_id, self.sequence, severity, b"%d" % self.sequence))
        self.database.append(items, self.database.facts.position, Position(self.run_id, self.sequence))

    @rule(missing=st.integers(0, 5))
    def restart_the_gateway(self, missing: int) -> None:
        self.run, self.sequence = self.run + 1, missing
        gap = Gap(self.run_id, 1, missing, DropReason.NO_LONGER_KEPT, earlier=True)
        self.waiting.append(Place(self.run_id, 0, 0, there=False))
        self.waiting += [Place(self.run_id, each, 0, there=False) for each in range(1, missing + 1)]
        self.database.append([gap], self.database.facts.position, Position(self.run_id, missing))

    @precondition(lambda self: any(each.there for each in self.waiting[self.flight :]))
    @rule(count=st.integers(1, 20))
    def have_no_room(self, count: int) -> None:
        for _ in range(count):
            free = [each for each in self.waiting[self.flight :] if each.there]
            if not free:
                return
            victim = next((each for each in free if each.severity == 1), free[0])
            victim.there = False
            self.dropped += 1
            assert self.database.drop_oldest()

    @rule()
    def begin_a_batch(self) -> None:
        before = self.batch
        self.batch = self.database.next_batch()
        assert (self.batch is None) == (not self.waiting)
        if before is not None:
            assert self.batch == before
        if self.batch:
            places = sum(_size(each) for each in self.batch.items)
            assert len({each.run_id for each in self.waiting[:places]}) == 1
            self.flight = places

    @precondition(lambda self: self.batch is not None)
    @rule(answered=st.booleans())
    def send(self, answered: bool) -> None:
        assert self.batch
        subject = self.batch.run_id, self.batch.first
        repeated = subject in self.hub
        if repeated:
            assert self.hub[subject] == self.batch, "a repeat is the same batch"
        else:
            self.hub[subject] = self.batch
            self.expected += self.waiting[: self.flight]
        if answered:
            self.database.delivered(self.batch, repeated=repeated)
            del self.waiting[: self.flight]
            self.batch, self.flight = None, 0
            return

    @rule()
    def crash(self) -> None:
        """Another process opens what is on the disk; nothing was closed in order."""
        copy = Path(tempfile.mkdtemp(prefix="outbox-model-"))
        shutil.copytree(self.directory, copy, dirs_exist_ok=True)
        self.database.close()
        shutil.rmtree(self.directory)
        self.directory = copy
        self.database = Database(copy, 64 * 1024 * 1024)
        self.database.open()

    @invariant()
    def it_adds_up(self) -> None:
        if not hasattr(self, "database"):
            return
        facts = self.database.facts
        assert facts.dropped == self.dropped
        assert facts.events == sum(each.there for each in self.waiting)
        found: list[tuple[str, int, bool]] = []
        for batch in self.hub.values():
            found += [place for item in batch.items for place in _places(item)]
        assert found == [(each.run_id, each.sequence, each.there) for each in self.expected]


def _size(item: Item) -> int:
    return sum(1 for _ in _places(item))


def _places(item: Item) -> Any:
    if isinstance(item, Gap) and item.earlier:
        yield item.run_id, 0, False
    for sequence in range(item.first, item.last + 1):
        yield item.run_id, sequence, isinstance(item, Event)


TestOutbox = OutboxMachine.TestCase
TestOutbox.settings = settings(
    max_examples=25, stateful_step_count=30, suppress_health_check=list(HealthCheck)
)
