import pytest

from common.errors import ExitCode
from console.receiver.address import StreamAddress
from console.receiver.errors import (
    StreamEndedError,
    StreamError,
    StreamRefusedError,
    ended,
    from_srt,
    no_frame_within,
)

OPEN = StreamAddress("robot", 7100)
LOCKED = StreamAddress("robot", 7100, passphrase="the wrong one")
WHERE = "../ext/srt/gstsrtsrc.c(206): gst_srt_src_fill (): /GstPipeline:pipeline0/GstSRTSrc:s:\n"


@pytest.mark.parametrize(
    ("address", "reason", "had_data", "kind", "text", "final"),
    [
        (
            OPEN,
            "Error on SRT socket: Connection timeout",
            False,
            StreamRefusedError,
            "no SRT listener",
            False,
        ),
        (OPEN, "Failed to authenticate: Password required", False, StreamRefusedError, "asks for a", True),
        (LOCKED, "Failed to authenticate: Incorrect password", False, StreamRefusedError, "not accept", True),
        (OPEN, "Error on SRT socket: Connection was broken", True, StreamEndedError, "ended", False),
    ],
)
def test_an_error_of_the_source_in_plain_words(
    *, address: StreamAddress, reason: str, had_data: bool, kind: type[StreamError], text: str, final: bool
) -> None:
    error = from_srt(address, WHERE + reason, had_data=had_data)
    assert type(error) is kind
    assert text in error.what
    assert "srt://robot:7100" in error.what
    assert error.final is final
    assert error.remedy
    assert "gst" not in str(error)


@pytest.mark.parametrize("error", [ended(OPEN), no_frame_within(OPEN, 2)])
def test_they_all_mean_unreachable(error: StreamError) -> None:
    assert error.exit_code == ExitCode.UNREACHABLE


def test_a_timeout_names_the_time() -> None:
    error = no_frame_within(OPEN, 2.5)
    assert "within 2.5 s" in error.what
