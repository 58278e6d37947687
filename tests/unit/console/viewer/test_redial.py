from dataclasses import replace

import pytest

from common.errors import UserError
from console.client.results import PreviewState, StreamTransport
from console.viewer.redial import BLOCKED_PAUSE_S, address_of, deadline_s, redial_backoff
from tests.unit.console.viewer.previews import NOTHING_KNOWN, preview


def test_everything_comes_from_the_endpoint() -> None:
    address = address_of(preview(PreviewState.RUNNING, port=7200, latency_ms=80, passphrase="0123456789"))
    assert address is not None
    assert (address.host, address.port, address.latency_ms) == ("127.0.0.1", 7200, 80)
    assert address.passphrase == "0123456789"


@pytest.mark.parametrize("state", [PreviewState.STARTING, PreviewState.FAULTED, PreviewState.UNKNOWN])
def test_a_preview_that_is_wanted_is_called_before_it_is_said_to_run(state: PreviewState) -> None:
    assert address_of(preview(state))


@pytest.mark.parametrize("state", [PreviewState.DISABLED, PreviewState.STOPPING])
def test_a_preview_that_is_off_is_not_called(state: PreviewState) -> None:
    assert address_of(preview(state)) is None


def test_without_an_endpoint_there_is_nothing_to_call() -> None:
    assert address_of(replace(NOTHING_KNOWN, state=PreviewState.RUNNING)) is None
    assert address_of(preview(PreviewState.RUNNING, transport=StreamTransport.UNKNOWN)) is None


def test_an_address_that_cannot_be_used_is_reported() -> None:
    with pytest.raises(UserError, match="passphrase"):
        address_of(preview(PreviewState.RUNNING, passphrase="short"))


def test_pauses_grow_to_their_limit_and_begin_anew() -> None:
    backoff = redial_backoff()
    assert [backoff.next_s() for _ in range(5)] == [0.1, 0.2, 0.4, 0.5, 0.5]
    backoff.reset()
    assert backoff.next_s() == 0.1


def test_what_calling_again_cannot_mend_is_called_seldom() -> None:
    assert BLOCKED_PAUSE_S >= 5


def test_silence_ends_a_call_sooner_than_a_slow_beginning() -> None:
    assert deadline_s(connected_s=10, frame_s=None) == 14
    assert deadline_s(connected_s=10, frame_s=12) == 13
