"""What an operator may rely on when SetPreviewMode has answered RUNNING."""

import asyncio

import pytest

from console.receiver.address import StreamAddress
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.eventually import eventually
from tests.support.free import udp_port_is_free
from tests.support.receiver import Receiver
from tests.support.running_gateway import running_gateway
from tests.support.running_preview import RunningPreview

pytestmark = pytest.mark.gst

ROUNDS = 10


async def test_a_viewer_connects_at_the_first_attempt(preview: RunningPreview) -> None:
    async with running_gateway(preview.socket) as operator:
        await eventually(operator.status, lambda it: it.preview.service_reachable, "contact")
        for _ in range(ROUNDS):
            answer = await operator.switch(True)
            assert answer.preview.state == states.PREVIEW_RUNNING
            assert not udp_port_is_free(preview.port)
            await asyncio.to_thread(one_frame, preview.port)
            await operator.switch(False)
            assert udp_port_is_free(preview.port)


def one_frame(port: int) -> None:
    # A receiver connects once: a refused handshake would end it.
    with Receiver(StreamAddress("127.0.0.1", port, latency_ms=20)) as viewer:
        viewer.next_frame(timeout_s=10)
