"""The alarm's tone, into a sink without a device."""

import time

import pytest

from common.errors import UserError
from console.receiver.tone import play_tone

pytestmark = pytest.mark.gst

LENGTH_S = 12 * 1024 / 44_100


def test_it_plays_to_its_end() -> None:
    began_s = time.monotonic()
    play_tone("fakesink sync=true")
    assert time.monotonic() - began_s >= LENGTH_S * 0.8, "as long as the tone is heard"


@pytest.mark.parametrize("sink", ["no-such-element", "filesink location=/proc/no-such-file"])
def test_a_sink_that_does_not_play_is_an_error_with_a_remedy(sink: str) -> None:
    with pytest.raises(UserError, match="no alarm can be heard") as caught:
        play_tone(sink)
    assert caught.value.remedy
