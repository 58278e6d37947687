"""Parses requests and checks them against the rules that the schema declares (buf.validate)."""

from typing import Any, Final

from google.protobuf.message import DecodeError, Message
from protovalidate import Validator, Violation

from common.errors import FieldViolation, InvalidRequestError, TooMuchError
from common.interceptors import Interceptor
from common.reasons import Reason
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import Method

_VALIDATOR: Final = Validator()
"""Compiles the rules of each message once."""


class Validation(Interceptor[CallContext]):
    """Turns the bytes of each request into a valid message. The contract's methods alone receive bytes.

    Args:
        max_request_bytes: a longer request is not parsed.
    """

    def __init__(self, max_request_bytes: int) -> None:
        self._max_request_bytes = max_request_bytes

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method is the contract's."""
        return method.of_contract

    def on_request(self, call: CallContext, request: Any) -> Any:
        """Returns the message.

        Raises:
            TooMuchError: the request is too long.
            InvalidRequestError: it can't be parsed, or breaks rules; each broken rule is named.
        """
        message_type = call.method.request_type
        assert message_type is not None  # noqa: S101  # the contract's methods have one
        if len(request) > self._max_request_bytes:
            raise TooMuchError(
                f"a request of {len(request)} bytes is too long; the limit is {self._max_request_bytes}",
                Reason.MESSAGE_TOO_LARGE,
            )
        try:
            message = message_type.FromString(request)
        except DecodeError as error:
            raise _unparsable(message_type) from error
        if call.request is None:
            call.request = message
        elif call.method.request_streaming:
            # Messages after the first are checked by hand: the rules cost more than a driver's command.
            return message
        if call.method.has_parameters:
            validate(message)
        return message


def validate(message: Message) -> None:
    """Checks a message against its rules.

    Raises:
        InvalidRequestError: it breaks some; each is named.
    """
    try:
        found = _VALIDATOR.collect_violations(message)
    except ValueError as error:
        # The validator parses it again, and is stricter with unknown fields than protobuf for Python.
        raise _unparsable(type(message)) from error
    if found:
        violations = tuple(_field_violation(each) for each in found)
        sentences = (f"{each.field}: {each.description}".removeprefix(": ") for each in violations)
        raise InvalidRequestError("; ".join(sentences), violations)


def _unparsable(message_type: type[Message]) -> InvalidRequestError:
    return InvalidRequestError(f"the request can't be parsed as {message_type.DESCRIPTOR.full_name}")


def _field_violation(violation: Violation) -> FieldViolation:
    proto = violation.proto
    path = proto.field.elements if proto.field else ()
    field = ".".join(each.field_name or "" for each in path)
    return FieldViolation(field, proto.message or proto.rule_id or "")
