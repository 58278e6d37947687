"""What the recorder and the gateway agree on for the connection of an export."""

from pathlib import Path

import pytest

from common.export_connection import KEY_BYTES, key_of, socket_beside


def test_the_socket_is_beside_the_recorders() -> None:
    assert socket_beside(Path("/run/robot-recorder/recorder.sock")) == Path(
        "/run/robot-recorder/recorder.sock.exports"
    )


def test_a_key_comes_back_from_its_digits() -> None:
    key = bytes(range(KEY_BYTES))
    assert key_of(key.hex()) == key


@pytest.mark.parametrize("digits", ["", "0", "zz" * KEY_BYTES, "00", "00" * 4096, b"00" * KEY_BYTES, None])
def test_anything_else_is_no_key(digits: object) -> None:
    assert key_of(digits) is None
