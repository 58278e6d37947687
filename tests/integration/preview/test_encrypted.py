"""An encrypted session from the operator's request to the decoded picture, through the real gateway."""

import asyncio
import logging
from pathlib import Path

import pytest

from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError
from console.receiver.receiver import Receiver
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.eventually import eventually
from tests.support.running_gateway import running_gateway
from tests.support.running_preview import RunningPreview

pytestmark = pytest.mark.gst

PICTURES = 10


@pytest.mark.parametrize("key_length_bytes", [16, 32])
async def test_the_api_hands_out_what_opens_the_stream_and_no_log_does(
    tmp_path: Path, key_length_bytes: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    settings = {"log_level": "debug", "srt": {"key_length_bytes": key_length_bytes}}
    passphrases = []
    with RunningPreview(tmp_path, settings) as preview:
        async with running_gateway(preview.socket, preview={"encrypted": True}) as operator:
            await eventually(operator.status, lambda it: it.preview.service_reachable, "contact")
            for _ in range(2):
                endpoint = (await operator.switch(True)).preview.endpoint
                assert endpoint.encrypted
                assert endpoint.passphrase not in endpoint.uri
                passphrases.append(endpoint.passphrase)
                await asyncio.to_thread(watch, preview.port, endpoint.passphrase)
                with pytest.raises(StreamError):
                    await asyncio.to_thread(watch, preview.port, "")
                off = await operator.switch(False)
                assert off.preview.state == states.PREVIEW_DISABLED
                assert off.preview.endpoint.passphrase == ""
        log = preview.log.read_text(encoding="utf-8")
    assert len(set(passphrases)) == 2, "each session has its own"
    assert "wish" in log, "the service logs what it is told"
    for passphrase in passphrases:
        assert len(passphrase) >= 10
        assert passphrase not in log
        assert passphrase not in caplog.text


def watch(port: int, passphrase: str) -> None:
    with Receiver(StreamAddress("127.0.0.1", port, 20, passphrase)) as receiver:
        for _ in range(PICTURES):
            assert not receiver.next_frame(timeout_s=10).corrupt
