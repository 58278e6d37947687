"""Requests come in as bytes; here, and only here, they are measured, read and held to the schema's rules."""

from typing import Final, Generic, TypeVar

from google.protobuf.message import DecodeError, Message
from protovalidate import Validator, Violation

from common.errors import FieldViolation, InvalidRequestError, TooMuchError
from common.reasons import Reason

MessageT = TypeVar("MessageT", bound=Message)

_VALIDATOR: Final = Validator()
"""Compiles the rules of each message once."""


class Requests(Generic[MessageT]):
    """Reads the requests of one method.

    Args:
        message: what they are.
        most_bytes: a longer one is not even read.
    """

    def __init__(self, message: type[MessageT], most_bytes: int) -> None:
        self._message = message
        self._most_bytes = most_bytes

    def read(self, data: bytes) -> MessageT:
        """The request.

        Raises:
            TooMuchError: it is too long.
            InvalidRequestError: it is no such message.
        """
        if len(data) > self._most_bytes:
            raise TooMuchError(
                f"a request of {len(data)} bytes is too long; at most {self._most_bytes} are taken",
                Reason.MESSAGE_TOO_LARGE,
            )
        try:
            return self._message.FromString(data)
        except DecodeError as error:
            raise InvalidRequestError(f"the request is no {self._message.DESCRIPTOR.full_name}") from error


def hold_to_rules(request: Message) -> None:
    """Looks at the rules that the schema declares for this request.

    Raises:
        InvalidRequestError: it breaks some; each is named.
    """
    found = _VALIDATOR.collect_violations(request)
    if found:
        violations = tuple(_named(each) for each in found)
        sentences = (f"{each.field}: {each.description}".removeprefix(": ") for each in violations)
        raise InvalidRequestError("; ".join(sentences), violations)


def _named(violation: Violation) -> FieldViolation:
    proto = violation.proto
    path = proto.field.elements if proto.field else ()
    field = ".".join(each.field_name or "" for each in path)
    return FieldViolation(field, proto.message or proto.rule_id or "")
