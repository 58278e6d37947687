"""The judge of torn frames, and the stream that it goes by."""

import pytest

from console.receiver.address import StreamAddress
from console.receiver.options import ReceiverOptions
from tests.support.free import free_udp_port
from tests.support.receiver import Receiver
from tests.support.sent_stream import SentStream
from tests.support.streams import MOVING_EVERYWHERE, SRT_PAYLOAD, SrtSender, encode
from tests.support.udp_link import Impairment, UdpLink
from tests.support.waiting import wait_until
from tests.support.whole_pictures import WholePictures

pytestmark = pytest.mark.gst

FRAMES = 60
GOP = 30
HIT = 10
LAST_NUMBER = (1 << 31) - 1
DATA = bytes([0xC0, 0, 0, 0])
ENCRYPTED_DATA = bytes([0xC8, 0, 0, 0])
"""Second word of a packet (draft-sharabayko-srt-01 3.1)."""
PATIENCE_S = 20
PATIENT = ReceiverOptions(max_age_s=1000)


@pytest.fixture(scope="module", params=["h264", "h265"])
def pieces(request: pytest.FixtureRequest) -> list[bytes]:
    """Frames of several packets each, in which everything moves."""
    return encode(request.param, FRAMES, gop=GOP, kbps=2000, pattern=MOVING_EVERYWHERE)


def test_a_frame_that_lacks_a_packet_is_torn_and_so_are_those_that_depend_on_it(pieces: list[bytes]) -> None:
    whole = WholePictures(b"".join(pieces))
    assert len(set(whole.fingerprints)) == FRAMES
    assert whole.torn(whole.fingerprints) == 0
    hit = pieces[HIT]
    assert len(hit) > SRT_PAYLOAD
    damaged = [*pieces[:HIT], hit[SRT_PAYLOAD:], *pieces[HIT + 1 :]]
    shown = WholePictures(b"".join(damaged)).fingerprints
    # GStreamer's demultiplexer drops the frame that was hit.
    assert whole.torn(shown) == GOP - HIT - 1
    assert whole.torn(shown[:HIT]) == 0


@pytest.mark.parametrize("loss", [0.0, 0.05])
def test_what_a_link_loses_was_sent(pieces: list[bytes], loss: float) -> None:
    port, sent = free_udp_port(), SentStream()
    stream = b"".join(pieces)
    with (
        SrtSender(port) as sender,
        UdpLink(port, Impairment(loss=loss), tap=sent.take) as link,
        Receiver(StreamAddress("127.0.0.1", link.port, latency_ms=20), options=PATIENT),
    ):
        assert sender.viewer_joined.wait(PATIENCE_S)
        for piece in pieces:
            sender.send(piece)
        wait_until(lambda: sent.size_bytes == len(stream), "all is sent", PATIENCE_S)
    assert sent.pictures().fingerprints == WholePictures(stream).fingerprints


def test_numbers_may_wrap_around_and_packets_come_again(pieces: list[bytes]) -> None:
    sent, stream = SentStream(), b"".join(pieces)
    payloads = [stream[at : at + SRT_PAYLOAD] for at in range(0, len(stream), SRT_PAYLOAD)]
    for index in (*range(len(payloads)), 0, 3):
        number = (LAST_NUMBER - 5 + index) % (LAST_NUMBER + 1)
        sent.take(number.to_bytes(4) + DATA + bytes(4) + b"call" + payloads[index])
        sent.take(b"\x80\x02" + bytes(30))  # an acknowledgement
    assert sent.pictures().fingerprints == WholePictures(stream).fingerprints


def test_an_encrypted_stream_is_not_taken_for_a_torn_one() -> None:
    sent = SentStream()
    sent.take(bytes(4) + ENCRYPTED_DATA + bytes(8) + bytes(188))
    with pytest.raises(AssertionError, match="encrypted"):
        sent.pictures()
