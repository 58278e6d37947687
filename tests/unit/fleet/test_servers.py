"""Which servers may be used without an authority: none that a network leads to."""

from pathlib import Path

import pytest

from fleet.servers import exposed_server


@pytest.mark.parametrize("host", ["127.0.0.1", "[::1]", "localhost"])
def test_this_machine_needs_no_authority(host: str) -> None:
    assert exposed_server([f"nats://{host}:4222", f"nats://{host}"], None) is None


@pytest.mark.parametrize(
    "server",
    [
        "nats://hub:4222",
        "nats://10.0.0.7",
        "nats://127.0.0.1.example:4222",
        "nats://127.0.0.1@hub:4222",
        "nats://[::2]:4222",
        "tls://127.0.0.1:4222",
        "tls://hub",
        "127.0.0.1:4222",
        "",
    ],
)
def test_others_do(server: str) -> None:
    assert exposed_server(["nats://127.0.0.1:4222", server], None) == server
    assert exposed_server([server], Path("ca.pem")) is None
