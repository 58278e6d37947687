"""One id per request, in the logs of both programs."""

import json
import re
from pathlib import Path

import pytest

from common.request_id import HEADER
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest
from tests.support.gateway_program import gateway_program
from tests.support.running_preview import RunningPreview
from tests.support.waiting import wait_until

pytestmark = pytest.mark.gst


def test_what_an_operator_asks_is_found_in_both_logs(tmp_path: Path) -> None:
    preview_dir, gateway_dir = tmp_path / "preview", tmp_path / "gateway"
    preview_dir.mkdir()
    gateway_dir.mkdir()
    with (
        RunningPreview(preview_dir, {"log_format": "json"}) as preview,
        gateway_program(gateway_dir, sources=[], preview={"socket": str(preview.socket)}) as gateway,
    ):
        wait_until(lambda: gateway.status().preview.service_reachable, "the two have met", 10)
        request = SetPreviewModeRequest(enabled=True)
        gateway.stub.SetPreviewMode(request, timeout=10, metadata=((HEADER, "shift-7"),))
        gateway.stub.SetPreviewMode(SetPreviewModeRequest(enabled=False), timeout=10)
        lines = [json.loads(line) for line in preview.log.read_text().splitlines()]
        ours = (gateway_dir / "gateway.log").read_text()
    desired = [line for line in lines if line["message"].startswith("desired state ")]
    assert [line["message"].partition(": ")[2] for line in desired] == [
        "on, balanced",
        "off",
    ]
    assert re.search(r"revision \d+ requested: on, balanced \[request shift-7\]", ours)
    assert desired[0]["request_id"] == "shift-7"
    made_here = re.search(r"revision \d+ requested: off \[request ([0-9a-f]{16})\]", ours)
    assert made_here, ours
    assert desired[1]["request_id"] == made_here[1]
