"""The gateway hears of a change of an upload when it happens, not with the next heartbeat."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import pytest

from bridge.app import serve
from bridge.config import BridgeSettings, GatewaySettings, HubSettings
from bridge.outbox.outbox import outbox
from bridge.outbox.uploads import StoredUploads
from bridge.uploads.queue import State, Upload
from common import broadcast
from fleet.receipt_keys import as_text
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.bridge.v1 import bridge_service_pb2_grpc as pb_grpc
from omniseer.gateway.v1.recording_pb2 import RECORDING_COPY_STATE_UNSPECIFIED
from tests.support.free import free_tcp_port
from tests.support.uploading import new_signer

_WITHIN_S = 60.0


@asynccontextmanager
async def bridge_with(upload: Upload, directory: Path) -> AsyncIterator[Any]:
    """A bridge with an upload in its queue, whose gateway and hub are away; yields its stub."""
    async with outbox(directory / "outbox", 64 << 20) as kept:
        await StoredUploads(kept).put_upload(upload)
    keys = directory / "receipts.pub"
    keys.write_text(as_text([new_signer().public_key]), encoding="ascii")
    settings = BridgeSettings(
        socket=directory / "bridge.sock",
        root=directory / "outbox",
        gateway=GatewaySettings(target=f"127.0.0.1:{free_tcp_port()}"),
        hub=HubSettings(servers=(f"nats://127.0.0.1:{free_tcp_port()}",), receipts=keys),
    )
    stop = asyncio.Event()
    task = asyncio.create_task(serve(settings, stop))
    try:
        async with grpc.aio.insecure_channel(f"unix:{settings.socket}") as channel:
            yield pb_grpc.BridgeServiceStub(channel)
    finally:
        stop.set()
        await task


async def test_a_cancelled_upload(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: what was notified had no one waiting for it."""
    monkeypatch.setattr(broadcast, "HEARTBEAT_S", 3600.0)
    upload = Upload(recording_id="one", size=1, state=State.QUEUED)
    async with asyncio.timeout(_WITHIN_S), bridge_with(upload, tmp_path) as bridge:
        states = bridge.WatchState(pb.WatchStateRequest(), wait_for_ready=True)
        while (await states.read()).status.uploads_waiting != 1:
            pass
        await bridge.CancelUpload(pb.CancelUploadRequest(recording_id="one"))
        while (state := await states.read()).status.uploads_waiting:
            pass
        (report,) = state.copies
        assert (report.recording_id, report.copy.state) == ("one", RECORDING_COPY_STATE_UNSPECIFIED)
        states.cancel()
