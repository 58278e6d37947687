"""An encrypted session from the operator's request to the decoded picture, through the real gateway."""

import asyncio
import logging
import socket
from pathlib import Path

import pytest

from console.doctor import srt_probe
from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.eventually import eventually
from tests.support.receiver import Receiver
from tests.support.running_gateway import running_gateway
from tests.support.running_preview import RunningPreview

pytestmark = pytest.mark.gst

PICTURES = 10
WRONG = "incorrect horse battery staple"


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
                assert offered_key_bytes(preview.port) == key_length_bytes
                await asyncio.to_thread(watch, preview.port, endpoint.passphrase)
                for wrong in ("", WRONG):
                    with pytest.raises(StreamError):
                        await asyncio.to_thread(watch, preview.port, wrong)
                off = await operator.switch(False)
                assert off.preview.state == states.PREVIEW_DISABLED
                assert off.preview.endpoint.passphrase == ""
        log = preview.log.read_text(encoding="utf-8")
    assert len(set(passphrases)) == 2, "each session has its own"
    assert "desired state" in log, "the service logs requests"
    for passphrase in passphrases:
        assert len(passphrase) >= 10
        assert passphrase not in log
        assert passphrase not in caplog.text


def offered_key_bytes(port: int) -> int:
    """How long the listener says that its AES keys are: in its first answer, in units of 8 bytes."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as caller:
        caller.settimeout(10)
        caller.sendto(srt_probe.induction(), ("127.0.0.1", port))
        answer = caller.recv(2048)
    assert srt_probe.is_answer(answer)
    return 8 * int.from_bytes(answer[20:22])


def watch(port: int, passphrase: str) -> None:
    with Receiver(StreamAddress("127.0.0.1", port, 20, passphrase)) as receiver:
        for _ in range(PICTURES):
            assert not receiver.next_frame(timeout_s=10).corrupt
