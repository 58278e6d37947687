import json
from typing import Any

from gateway.config import GatewaySettings
from gateway.shown_settings import shown_settings


def test_topics_types_and_paths_stay_on_the_robot() -> None:
    text = shown_settings(GatewaySettings())
    assert "/" not in text
    for private in ("topic", "nav_msgs", "socket", "reliability"):
        assert private not in text


def test_what_decides_about_the_status_is_shown() -> None:
    shown = json.loads(shown_settings(GatewaySettings(name="lab")))
    assert shown["name"] == "lab"
    assert shown["faults"]["temperature_c"] == {"raise_at": 85.0, "clear_at": 80.0}
    assert shown["sources"][0]["kind"] == "odometry"
    assert shown["sources"][0]["stale_after_ms"] == 1000
    assert shown["grpc"]["port"] == 50051


def test_a_secret_is_hidden_whatever_it_is_called() -> None:
    class Later(GatewaySettings):
        access: dict[str, Any] = {"admin_token": "t0p", "tls_key_file": "k", "users": ["ada"]}  # noqa: RUF012

    shown = json.loads(shown_settings(Later()))
    assert shown["access"] == {"users": ["ada"]}
