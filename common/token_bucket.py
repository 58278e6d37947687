"""Token bucket: a rate limit that permits bursts."""

from dataclasses import dataclass


@dataclass(slots=True)
class TokenBucket:
    """Tokens that are refilled at a constant rate up to a capacity; each use takes one. Pure.

    Attributes:
        tokens: left after the newest use.
        updated_s: when that was; monotonic seconds.
    """

    tokens: float
    updated_s: float

    def take(self, now_s: float, *, capacity: float, refill_per_s: float) -> bool:
        """Takes one token, and returns whether there was one."""
        self.tokens = min(capacity, self.tokens + (now_s - self.updated_s) * refill_per_s)
        self.updated_s = now_s
        if self.tokens < 1:
            return False
        self.tokens -= 1
        return True
