"""Pacing of bytes: a rate limit that spreads them evenly."""


class Pace:
    """Limits a rate of bytes: a token bucket without burst, by virtual scheduling (ITU-T I.371). Pure.

    Args:
        bytes_per_s: the limit; 0 for none.
    """

    def __init__(self, bytes_per_s: int) -> None:
        self.bytes_per_s = bytes_per_s
        self._due_s = 0.0

    def delay_s(self, now_s: float, size: int) -> float:
        """Returns how long to wait before so many bytes may leave, and counts them."""
        if not self.bytes_per_s:
            return 0.0
        due_s = max(self._due_s, now_s)
        self._due_s = due_s + size / self.bytes_per_s
        return due_s - now_s
