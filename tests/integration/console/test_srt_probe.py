"""The doctor's question to a UDP port, asked of the real SRT library."""

import pytest

from console.doctor.srt_probe import answers_as_srt
from tests.support.free import free_udp_port
from tests.support.streams import SrtSender

pytestmark = pytest.mark.gst


@pytest.mark.parametrize("passphrase", ["", "correct horse battery"])
def test_a_listener_answers_and_counts_no_viewer(passphrase: str) -> None:
    port = free_udp_port()
    with SrtSender(port, passphrase=passphrase) as sender:
        for _ in range(20):
            assert answers_as_srt("127.0.0.1", port)
        assert not sender.viewer_joined.is_set()
    assert not answers_as_srt("127.0.0.1", port)
