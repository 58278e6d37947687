"""How twist_mux ranks its inputs and its locks, by its parameters, and what of that is wrong. Pure."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from common.findings import Finding, good, note, wrong
from drive.doctor.facts import GraphFacts, Rank

INPUTS: Final = "topics"
LOCKS: Final = "locks"
"""Groups of twist_mux's parameters: `topics.joystick.priority` for example."""
_VALUES: Final = frozenset({"topic", "priority", "timeout"})
MAX_VALUES: Final = 192
"""Of 64 inputs and locks."""


def wanted(names: Iterable[str]) -> list[str]:
    """Returns those parameters of a multiplexer that say how it ranks."""
    return [name for name in names if name.rpartition(".")[2] in _VALUES][:MAX_VALUES]


def ranks_in(values: Mapping[str, Any], namespace: str = "") -> tuple[Rank, ...]:
    """Returns the inputs and locks that a multiplexer's parameters describe as twist_mux's do.

    Args:
        values: the parameters.
        namespace: of the multiplexer, without the first slash.
    """
    entries = defaultdict[str, dict[str, Any]](dict)
    for name, value in values.items():
        entry, _, key = name.rpartition(".")
        entries[entry][key] = value
    return tuple(rank for entry, each in entries.items() if (rank := _rank(entry, each, namespace)))


def _rank(entry: str, values: Mapping[str, Any], namespace: str) -> Rank | None:
    topic, priority, timeout_s = values.get("topic"), values.get("priority"), values.get("timeout")
    if not isinstance(topic, str) or not isinstance(priority, int):
        return None
    return Rank(
        # A name that does not begin with a slash is one of the node's namespace.
        topic if topic.startswith("/") else f"/{namespace}/{topic}".replace("//", "/"),
        priority,
        timeout_s if isinstance(timeout_s, float) else 0.0,
        lock=entry.startswith(f"{LOCKS}."),
    )


def rank_findings(facts: GraphFacts) -> Iterator[Finding]:
    """Yields what the ranks show, and of what lies behind a multiplexer that they do not."""
    ours = {topic.name for topic in facts.outputs}
    inputs = [each for each in facts.ranks if not each.lock]
    own = [each for each in inputs if each.topic in ours]
    others = [each for each in inputs if each.topic not in ours]
    if own:
        yield _priority(max(own, key=lambda each: each.priority), others)
    elif facts.mux_output and any(topic.subscribers for topic in facts.outputs):
        yield _unknown("mux.priority", " and ".join(sorted(ours)))
    if facts.lock and facts.lock.subscribers:
        locks = [each for each in facts.ranks if each.lock and each.topic == facts.lock.name]
        if not locks:
            yield _unknown("mux.lock.priority", facts.lock.name)
        for each in locks:
            yield from _lock(each, others)


def _unknown(check: str, topic: str) -> Finding:
    return note(
        check,
        f"no node that takes {topic} says how it ranks it",
        "What outranks it can't be seen from here: it is not twist_mux, or its topics are renamed",
        "Look at the multiplexer's own configuration",
    )


def _priority(own: Rank, others: Iterable[Rank]) -> Finding:
    above = [each for each in others if each.priority >= own.priority]
    if not above:
        return good("mux.priority", f"{own} has the highest priority of the multiplexer's inputs")
    return note(
        "mux.priority",
        f"{_named(above)} does not rank below {own}",
        "While it sends, a driver's velocities and the zeros of a stop may not reach the base; only the lock "
        "then ends its motion",
        "Give robot-drive's input the highest priority, unless a person at the robot is to outrank it",
    )


def _lock(lock: Rank, others: Iterable[Rank]) -> Iterator[Finding]:
    unmasked = [each for each in others if each.priority >= lock.priority]
    if unmasked:
        yield wrong(
            "mux.lock.priority",
            f"{_named(unmasked)} does not rank below the lock on {lock}",
            "A stop does not silence it: the robot moves on",
            "Give the lock the highest priority of all: 255",
        )
    else:
        yield good("mux.lock.priority", f"the lock on {lock} ranks above the inputs of others")
    if lock.timeout_s:
        yield wrong(
            "mux.lock.timeout",
            f"the lock on {lock.topic} has a timeout of {lock.timeout_s:g} s",
            "The multiplexer locks by itself after that silence, and robot-drive is silent without a stop",
            "Set its timeout to 0.0",
        )


def _named(ranks: Iterable[Rank]) -> str:
    return ", ".join(map(str, sorted(ranks, key=lambda each: (-each.priority, each.topic))))
