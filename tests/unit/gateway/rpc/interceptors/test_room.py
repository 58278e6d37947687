"""When all that the gateway serves at once is taken, a stop finds room."""

import pytest

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.rpc.calls.methods import TELEOP
from gateway.rpc.interceptors.room import MAX_OPEN, Room
from tests.support.calls import call_of


def test_a_stop_finds_room_where_no_other_call_does() -> None:
    room = Room()
    for _ in range(MAX_OPEN):
        room.on_call(call_of())
    with pytest.raises(TooMuchError) as seen:
        room.on_call(call_of())
    assert seen.value.reason is Reason.TOO_MANY_REQUESTS
    stop = call_of("StopRobot", service=TELEOP.full_name)
    room.on_call(stop)
    room.on_end(stop, None)
    room.on_end(call_of(), None)
    room.on_call(call_of())


def test_not_so_a_stop_of_an_unknown_caller() -> None:
    room = Room()
    for _ in range(MAX_OPEN):
        room.on_call(call_of())
    stop = call_of("StopRobot", service=TELEOP.full_name)
    stop.unlimited = False
    with pytest.raises(TooMuchError):
        room.on_call(stop)
