"""Faults of a real gateway: found by itself, shown to its callers, cleared when their reason is gone."""

import logging
from pathlib import Path
from typing import Any

import pytest

from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_WARNING
from tests.support.eventually import eventually
from tests.support.preview_double import PreviewDouble, serve_double
from tests.support.running_gateway import running_gateway

AT_ONCE = {"startup_grace_ms": 0, "clear_after_ms": 200}


def by_id(status: Any) -> dict[str, Any]:
    return {fault.id: fault for fault in status.faults}


async def test_a_preview_service_that_is_not_there_is_a_fault_until_it_comes(tmp_path: Path) -> None:
    socket = tmp_path / "preview.sock"
    async with running_gateway(socket, faults=AT_ONCE) as operator:
        status = await eventually(operator.status, lambda it: "preview.unreachable" in by_id(it), "the fault")
        fault = by_id(status)["preview.unreachable"]
        assert (fault.active, fault.severity) == (True, FAULT_SEVERITY_WARNING)
        assert "robot-preview" in fault.remedy
        server = await serve_double(socket, PreviewDouble())
        try:
            overlay = await eventually(
                operator.overlay,
                lambda it: not by_id(it.status)["preview.unreachable"].active,
                "the end of the fault",
            )
        finally:
            await server.stop(None)
    assert by_id(overlay.status)["preview.unreachable"].HasField("cleared_age_ms")
    messages = [event.message for event in overlay.events]
    assert messages == [f"warning: {fault.message}", f"cleared: {fault.message}"]


async def test_a_limit_that_the_computer_breaks_is_found_without_a_call(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async def log() -> str:
        return caplog.text

    faults = {**AT_ONCE, "memory_percent": {"raise_at": 0.2, "clear_at": 0.1}}
    with caplog.at_level(logging.INFO):
        async with running_gateway(
            tmp_path / "p.sock", faults=faults, platform={"interval_ms": 100}
        ) as operator:
            await eventually(log, lambda it: "event: warning: memory is nearly full" in it, "the event")
            status = await operator.status()
    assert by_id(status)["platform.memory"].active
    assert status.gateway.requests_served == 0, "it was asked before"
