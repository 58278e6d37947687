"""Operators who come, read, watch, subscribe and go."""

from console.client import GatewayClient


def come_and_go(target: str, operators: int) -> None:
    """Each operator has a connection, and leaves two streams in the middle."""
    for _ in range(operators):
        with GatewayClient(target) as client:
            client.status()
            client.overlay()
            next(client.watch_status(0.1))
            next(client.events())
