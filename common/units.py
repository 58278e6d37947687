"""Quantities for people, where more than one program shows them."""

from typing import Final

_KBIT_PER_MBIT: Final = 1000


def bit_rate(kbps: float) -> str:
    """Returns a bit rate: 850 kbit/s, 2.98 Mbit/s."""
    return f"{kbps:.0f} kbit/s" if kbps < _KBIT_PER_MBIT else f"{kbps / _KBIT_PER_MBIT:.2f} Mbit/s"
