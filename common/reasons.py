"""Machine-readable reasons of refused calls, sent as google.rpc.ErrorInfo with every refusal."""

from enum import StrEnum


class Reason(StrEnum):
    """All reasons; docs/errors.md documents each, which a test verifies.

    A reason never changes its meaning. Clients must expect unknown reasons.
    """

    INVALID_REQUEST = "INVALID_REQUEST"
    """The request is invalid; google.rpc.BadRequest names the fields."""
    UNKNOWN_SERVICE = "UNKNOWN_SERVICE"
    """The health service knows no service of that name."""
    PREVIEW_NOT_RUNNING = "PREVIEW_NOT_RUNNING"
    """The preview is not running, and the request makes sense only while it is."""
    MESSAGE_TOO_LARGE = "MESSAGE_TOO_LARGE"
    """The request exceeds the gateway's size limit."""
    TOO_MANY_CONNECTIONS = "TOO_MANY_CONNECTIONS"
    """Other clients use all connections that the gateway, or the caller's address, may have."""
    TOO_MANY_STREAMS = "TOO_MANY_STREAMS"
    """The connection has as many streams open as permitted."""
    TOO_MANY_REQUESTS = "TOO_MANY_REQUESTS"
    """The connection exceeds its request rate; google.rpc.RetryInfo says when to retry."""
    CREDENTIAL_MISSING = "CREDENTIAL_MISSING"
    """The call carries no credential."""
    CREDENTIAL_UNKNOWN = "CREDENTIAL_UNKNOWN"
    """The credential is not one of this robot's."""
    CREDENTIAL_REVOKED = "CREDENTIAL_REVOKED"
    """The credential was revoked."""
    CREDENTIAL_EXPIRED = "CREDENTIAL_EXPIRED"
    """The credential has expired."""
    CREDENTIAL_NOT_YET_VALID = "CREDENTIAL_NOT_YET_VALID"
    """The credential is not valid yet, by the robot's clock."""
    CREDENTIALS_UNREADABLE = "CREDENTIALS_UNREADABLE"
    """The gateway can't read its list of credentials, so that it accepts none."""
    ROLE_TOO_LOW = "ROLE_TOO_LOW"
    """The caller is authenticated, but the method needs a higher role."""
    LOCKED_OUT = "LOCKED_OUT"
    """Too many wrong credentials came from this address; google.rpc.RetryInfo says when to retry."""
    INTERNAL = "INTERNAL"
    """A defect of the gateway; its log has the details."""
