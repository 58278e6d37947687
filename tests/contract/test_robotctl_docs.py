"""docs/robotctl.md names every key of the JSON documents, and none that is not."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from common.findings import findings_json, good
from console.cli.info import info_json
from console.cli.json_form import json_form
from console.client.mapping.methods import GET_GATEWAY_INFO, GET_OVERLAY_SNAPSHOT, GET_SYSTEM_STATUS
from omniseer.gateway.v1.overlay_pb2 import OverlaySnapshot
from omniseer.gateway.v1.robot_gateway_pb2 import GetGatewayInfoResponse
from omniseer.gateway.v1.system_status_pb2 import SystemStatus

PAGE = (Path(__file__).parents[2] / "docs/robotctl.md").read_text(encoding="utf-8")
CHOICE = re.compile(r"\{([^}]+)\}")


def documented(heading: str) -> set[str]:
    chapter = PAGE.split(f"### {heading}\n")[1].split("\n### ")[0].split("\n## ")[0]
    keys = re.findall(r"^\| `([^`]+)` \|", chapter, re.MULTILINE)
    return {each for key in keys for each in choices(key)}


def choices(key: str) -> Iterator[str]:
    """`power.{a,b}.present` is two keys."""
    found = CHOICE.search(key)
    if not found:
        yield key
        return
    for word in found[1].split(","):
        yield from choices(key.replace(found[0], word, 1))


def keys_in(document: Any, above: str = "") -> Iterator[str]:
    """Every key, objects that are always there by their parts only."""
    if isinstance(document, list):
        yield above
        for item in document:
            yield from keys_in(item, f"{above}[]") if isinstance(item, dict) else ()
        return
    for key, value in document.items():
        path = f"{above}.{key}" if above else key
        if isinstance(value, dict | list):
            yield from keys_in(value, path)
        else:
            yield path


def filled(message: Message) -> bytes:
    fill(message)
    return message.SerializeToString()


def fill(message: Any) -> None:
    """Every part there and available, every list with one item."""
    for field in message.DESCRIPTOR.fields:
        if field.message_type:
            fill(getattr(message, field.name).add() if field.is_repeated else getattr(message, field.name))
            if not field.is_repeated:
                getattr(message, field.name).SetInParent()
        elif field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
            setattr(message, field.name, True)


MAY_BE_NULL = {"preview.endpoint", "preview.encoder", "preview.video"}
"""Objects that have a line of their own."""


@pytest.mark.parametrize(
    ("heading", "document", "elsewhere"),
    [
        pytest.param(
            "status --json",
            json_form(GET_SYSTEM_STATUS.decode(filled(SystemStatus()))),
            MAY_BE_NULL,
            id="status",
        ),
        pytest.param(
            "overlay --json",
            json_form(GET_OVERLAY_SNAPSHOT.decode(filled(OverlaySnapshot()))) | {"status": 0},
            set(),
            id="overlay",
        ),
        pytest.param(
            "info --json",
            info_json(GET_GATEWAY_INFO.decode(filled(GetGatewayInfoResponse()))) | {"gateway": 0},
            set(),
            id="info",
        ),
        pytest.param("doctor --json", findings_json([good("tcp", "answers")]), set(), id="doctor"),
    ],
)
def test_the_page_lists_exactly_the_keys(heading: str, document: Any, elsewhere: set[str]) -> None:
    assert documented(heading) - elsewhere == set(keys_in(document))
    assert elsewhere <= documented(heading)


def test_the_test_would_notice() -> None:
    assert set(choices("a.{b,c}.d")) == {"a.b.d", "a.c.d"}
    assert set(keys_in({"a": {"b": 1}, "c": [{"d": [], "e": 2}]})) == {"a.b", "c", "c[].d", "c[].e"}
