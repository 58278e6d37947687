"""What becomes of the hub's requests. Pure: decides and remembers; `gateway/rpc/hub_requests.py` acts.

The first rule that applies decides:

request                                             what follows
it was answered                                     the same answer again, nothing else
an action that this gateway does not know           REFUSED
its action is not in `bridge.allowed_requests`      REFUSED
expired                                             REFUSED
more than RATE_PER_MINUTE, after BURST at once      REFUSED
any other                                           carried out, once: DONE, or REFUSED as invalid, or FAILED
"""

from collections import OrderedDict
from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum
from typing import Final

from common.token_bucket import TokenBucket
from gateway.status.cloud import HubAction, HubRequest

RATE_PER_MINUTE: Final = 6
"""Requests that are carried out."""
BURST: Final = 3
MOST_REFUSED: Final = 256
"""Refused requests whose answer is remembered; refusing one again costs nothing."""
MOST_DONE: Final = 1024
"""The same of those that were carried out: at RATE_PER_MINUTE those of nearly three hours."""


class Outcome(Enum):
    """How a request was answered."""

    DONE = "done"
    REFUSED = "refused"
    """Not allowed, or invalid."""
    FAILED = "failed"
    """Allowed, and failed."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a request.

    Attributes:
        message: for people.
        recording_id: of the recording that a snapshot became, or that is uploaded; otherwise empty.
    """

    outcome: Outcome
    message: str
    recording_id: str = ""


class HubRequestRules:
    """Decides about each request.

    Args:
        allowed: by the configuration.
        now_s: monotonic seconds.
    """

    def __init__(self, allowed: Collection[HubAction], now_s: float) -> None:
        self._allowed = frozenset(allowed)
        self._bucket = TokenBucket(BURST, now_s)
        self._refused: OrderedDict[str, Answer] = OrderedDict()
        self._done: OrderedDict[str, Answer] = OrderedDict()

    def known(self, request_id: str) -> Answer | None:
        """Returns the answer that a request got; None for one that has none yet."""
        return self._done.get(request_id) or self._refused.get(request_id)

    def refusal(self, request: HubRequest, now_s: float) -> Answer | None:
        """Returns why a request without an answer is not carried out; None for one that is to be, now."""
        why = self._why_not(request, now_s)
        if why is None:
            return None
        answer = Answer(Outcome.REFUSED, why)
        _remember(self._refused, request.request_id, answer, MOST_REFUSED)
        return answer

    def carried_out(self, request_id: str, answer: Answer) -> None:
        """Remembers what became of a request that was not refused."""
        _remember(self._done, request_id, answer, MOST_DONE)

    def _why_not(self, request: HubRequest, now_s: float) -> str | None:
        action = request.action
        if action is None:
            return "this robot does not know such a request"
        if action not in self._allowed:
            return f"this robot's gateway does not allow it: bridge.allowed_requests lacks '{action.value}'"
        if now_s >= request.expires_s:
            return "it has expired"
        if not self._bucket.take(now_s, capacity=BURST, refill_per_s=RATE_PER_MINUTE / 60):
            return f"too many requests: this robot carries out {RATE_PER_MINUTE} a minute"
        return None


def _remember(answers: OrderedDict[str, Answer], request_id: str, answer: Answer, most: int) -> None:
    answers[request_id] = answer
    while len(answers) > most:
        answers.popitem(last=False)
