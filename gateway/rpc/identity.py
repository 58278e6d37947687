"""Who calls: what a call shows, and who the guard found it to be."""

import hashlib
import ssl
from contextvars import ContextVar
from functools import lru_cache
from typing import Final

from common.rpc import Context
from gateway.access.credential import Principal

TOKEN_HEADER: Final = "authorization"
_SCHEME: Final = "bearer"
_CERTIFICATE: Final = "x509_pem_cert"
_REMEMBERED: Final = 256

_caller: ContextVar[Principal | None] = ContextVar("caller", default=None)


def begin(principal: Principal | None) -> None:
    """The task that runs now serves this caller, until it ends."""
    _caller.set(principal)


def caller() -> Principal | None:
    """Who is served; None where the gateway does not ask."""
    return _caller.get()


def caller_name(_context: Context) -> str:
    """Who is served, by name; empty where the gateway does not ask."""
    found = _caller.get()
    return found.name if found else ""


def token_of(context: Context) -> str | None:
    """The bearer token that a call shows; None for none, "" for something that is no bearer token."""
    for key, value in context.invocation_metadata() or ():
        if key == TOKEN_HEADER:
            scheme, _, text = (value if isinstance(value, str) else "").partition(" ")
            return text.strip() if scheme.lower() == _SCHEME else ""
    return None


def fingerprint_of(context: Context) -> str | None:
    """Of the certificate that the connection showed, if any; TLS has proved that its key is there."""
    found = context.auth_context().get(_CERTIFICATE)
    return _fingerprint(next(iter(found))) if found else None


@lru_cache(maxsize=_REMEMBERED)
def _fingerprint(pem: bytes) -> str:
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(pem.decode("ascii"))).hexdigest()
