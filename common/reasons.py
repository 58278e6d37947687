"""Why a call was refused: stable words for programs, sent as google.rpc.ErrorInfo with every refusal."""

from enum import StrEnum


class Reason(StrEnum):
    """The whole table; docs/errors.md gives each a sentence, and a test holds it to that.

    A word is never given another meaning. Clients must expect words that they don't know.
    """

    INVALID_REQUEST = "INVALID_REQUEST"
    """The request makes no sense as it stands; google.rpc.BadRequest names the fields."""
    """The state of things forbids it."""
    UNKNOWN_SERVICE = "UNKNOWN_SERVICE"
    """The health service knows no service of that name."""
    MESSAGE_TOO_LARGE = "MESSAGE_TOO_LARGE"
    """The request is longer than this gateway takes."""
    TOO_MANY_CONNECTIONS = "TOO_MANY_CONNECTIONS"
    """Others have taken all connections that this gateway serves."""
    TOO_MANY_STREAMS = "TOO_MANY_STREAMS"
    """This connection has as many streams open as one may have."""
    TOO_MANY_REQUESTS = "TOO_MANY_REQUESTS"
    """This connection asks more often than one may; google.rpc.RetryInfo says when it may again."""
    CREDENTIAL_MISSING = "CREDENTIAL_MISSING"
    """Nothing in the request says who asks."""
    CREDENTIAL_UNKNOWN = "CREDENTIAL_UNKNOWN"
    """What was shown is none of this robot's credentials."""
    CREDENTIAL_REVOKED = "CREDENTIAL_REVOKED"
    """It was one, until it was revoked."""
    CREDENTIAL_EXPIRED = "CREDENTIAL_EXPIRED"
    """It was one, until its time was over."""
    CREDENTIAL_NOT_YET_VALID = "CREDENTIAL_NOT_YET_VALID"
    """It will be one later, by the robot's clock."""
    ROLE_TOO_LOW = "ROLE_TOO_LOW"
    """The caller is known and may not do this."""
    LOCKED_OUT = "LOCKED_OUT"
    """Too many wrong credentials came from this address; google.rpc.RetryInfo says when it may try again."""
    INTERNAL = "INTERNAL"
    """A defect of the gateway. Its log says more."""
