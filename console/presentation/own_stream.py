"""The stream as this computer receives it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OwnStream:
    """How the pictures of this window come, and over what link.

    Args:
        text: the delivery with its figures, for people.
        loss_percent: share of the packets of the last second that were missing at first; None if unknown.
        is_fallback: whether pictures come later than they could, because direct delivery is not possible.
    """

    text: str
    loss_percent: float | None = None
    is_fallback: bool = False
