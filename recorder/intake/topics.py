"""Which topics of the graph are to be recorded."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

NAME: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
"""Names of topics (ROS 2 design, "Topic and Service name mapping"); the graph can hold others."""
_LONGEST: Final = 255
MAX_CHANNELS: Final = 1000
"""Topics and types at a time; the graph may announce any number."""


class Selects(Protocol):
    """A preset."""

    def selects(self, topic: str) -> bool:
        """Returns whether the topic is recorded."""


@dataclass(frozen=True, slots=True)
class Selected:
    """What is to be recorded, and what stands in the way.

    Attributes:
        presets: by topic and type: the presets that record it.
        problem: for people; empty if there is none.
    """

    presets: Mapping[tuple[str, str], frozenset[str]]
    problem: str = ""


def selected(node: Any, presets: Mapping[str, Selects], wanted: frozenset[str]) -> Selected:
    """Returns the topics in the graph that a wanted preset records.

    Raises:
        Exception: rclpy's, if not even the nodes can be listed.
    """
    found: dict[tuple[str, str], frozenset[str]] = {}
    for topic, types in _announced(node):
        if len(topic) > _LONGEST or not NAME.fullmatch(topic):
            continue
        selecting = frozenset(name for name, preset in presets.items() if preset.selects(topic))
        if not selecting & wanted:
            continue
        for each in types:
            if len(found) >= MAX_CHANNELS:
                return Selected(
                    found, f"more than {MAX_CHANNELS} topics are announced: the others are left out"
                )
            found[topic, each] = selecting
    return Selected(found)


def _announced(node: Any) -> Sequence[tuple[str, Sequence[str]]]:
    try:
        return list(node.get_topic_names_and_types())
    except UnicodeDecodeError:
        # One name that is not UTF-8 spoils the list of all.
        return list(_announced_by_nodes(node))


def _announced_by_nodes(node: Any) -> Iterator[tuple[str, Sequence[str]]]:
    for name, namespace in node.get_node_names_and_namespaces():
        try:
            yield from node.get_publisher_names_and_types_by_node(name, namespace)
        except (RuntimeError, ValueError):
            continue  # it has left the graph, or it is the one with that name
