"""An encrypted session from the operator's request to the decoded picture, through the real gateway."""

import asyncio
import logging
import os
import socket
import subprocess
from pathlib import Path
from typing import Any

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


EVERYWHERE = {"bind": "0.0.0.0"}  # noqa: S104  # what this test is about


@pytest.mark.parametrize(
    ("srt", "settings", "encrypted", "logged"),
    [
        (EVERYWHERE, {}, True, "the video is encrypted; its listener is at 0.0.0.0, UDP port {}"),
        (
            EVERYWHERE,
            {"preview": {"encrypted": False}},
            False,
            "the video is not encrypted; anyone who reaches its listener at 0.0.0.0, UDP port {} can watch "
            "(preview.encrypted is false in the gateway's configuration)",
        ),
        (
            EVERYWHERE,
            {"security": {"insecure": True}},
            False,
            "anyone who reaches its listener at 0.0.0.0, UDP port {} can watch (security.insecure is set",
        ),
        ({}, {}, False, "the video is not encrypted; its listener at 127.0.0.1"),
        # As in a container: bound to all of its own addresses, and published on one of the machine's.
        (EVERYWHERE | {"published_on": "127.0.0.1"}, {}, False, "is for this machine alone"),
        (EVERYWHERE | {"published_on": "10.0.0.5"}, {}, True, "its listener is at 10.0.0.5, UDP port {}"),
    ],
)
async def test_without_credentials_the_listener_decides(
    tmp_path: Path,
    *,
    srt: dict[str, str],
    settings: dict[str, Any],
    encrypted: bool,
    logged: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    with RunningPreview(tmp_path, {"srt": srt}) as preview:
        async with running_gateway(preview.socket, **settings) as operator:
            await eventually(operator.status, lambda it: it.preview.service_reachable, "contact")
            endpoint = (await operator.switch(True)).preview.endpoint
            assert (endpoint.encrypted, bool(endpoint.passphrase)) == (encrypted, encrypted)
            # As a caller in a tunnel, who has no credential.
            assert (await operator.status()).preview.endpoint.passphrase == endpoint.passphrase
            # Our own client, and a program that is not ours.
            await asyncio.to_thread(watch, preview.port, endpoint.passphrase)
            assert await asyncio.to_thread(plays, preview.port, endpoint.passphrase)
            assert await asyncio.to_thread(plays, preview.port, "") is not encrypted
        assert logged.format(preview.port) in caplog.text
        assert f"viewers reach the listener at {srt.get('published_on', srt.get('bind', '127.0.0.1'))}" in (
            preview.log.read_text(encoding="utf-8")
        )


async def test_what_was_requested_before_the_service_came_is_encrypted_as_well(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "preview.sock") as operator:
        reply = await operator.switch(True)
        assert reply.preview.state == states.PREVIEW_FAULTED
        with RunningPreview(tmp_path, {"srt": EVERYWHERE}) as preview:
            assert preview.socket == tmp_path / "preview.sock"
            status = await eventually(
                operator.status, lambda it: it.preview.state == states.PREVIEW_RUNNING, "it runs"
            )
            assert status.preview.endpoint.encrypted
            await asyncio.to_thread(watch, preview.port, status.preview.endpoint.passphrase)
            assert not await asyncio.to_thread(plays, preview.port, "")


def plays(port: int, passphrase: str) -> bool:
    """Whether ffmpeg gets pictures."""
    address = f"srt://127.0.0.1:{port}?mode=caller"
    command = [
        "ffmpeg",
        "-v",
        "error",
        "-nostdin",
        # By default it looks at five seconds of the stream before it shows anything.
        "-analyzeduration",
        "500000",
        "-i",
        f"{address}&passphrase={passphrase}" if passphrase else address,
    ]
    # The libraries of the ROS wheels don't concern foreign programs.
    environment = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    done = subprocess.run(
        [*command, "-frames:v", str(PICTURES), "-f", "null", "-"],
        env=environment,
        capture_output=True,
        timeout=60,
        check=False,
    )
    return done.returncode == 0


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
            receiver.next_frame(timeout_s=10)
