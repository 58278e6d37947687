"""The components' newest words, put together from messages that each tell of some of them."""

from typing import Final

from gateway.status.values import Diagnostics

COMPONENTS_KEPT: Final = 256
"""Beyond it, the components are forgotten that have been silent longest."""


def merged(known: Diagnostics, newer: Diagnostics) -> Diagnostics:
    """What is known once `newer` has come: it replaces what those have said whom it names."""
    items = {item.component: item for item in known.items}
    for item in newer.items:
        # Taken out first, so that the order is the order of speaking.
        items.pop(item.component, None)
        items[item.component] = item
    return Diagnostics(tuple(items.values())[-COMPONENTS_KEPT:])
