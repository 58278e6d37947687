"""How benchmarks call a gateway."""

from collections.abc import Awaitable, Callable
from typing import Any, Final

from gateway.access.login_bundle import LoginBundle

Call = Callable[[], Awaitable[Any]]
Metadata = tuple[tuple[str, str], ...]

OWN_CONNECTION: Final = (("grpc.use_local_subchannel_pool", 1),)
"""Options of a channel with a connection of its own: by default, equal channels share one."""


def call(method: Any, request: Any, metadata: Metadata = ()) -> Call:
    """Returns what calls a method with the same request each time."""
    return lambda: method(request, metadata=metadata)


def authorization(bundle: LoginBundle) -> Metadata:
    """Returns the metadata that authenticates a call."""
    return (("authorization", f"Bearer {bundle.token}"),)
