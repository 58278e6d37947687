"""CompressedVideo, judged by rosbags' own decoder."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from recorder.video import message

TYPES = get_typestore(Stores.ROS2_JAZZY)
OWN, OTHERS = message.SCHEMA.decode().split("=" * 80 + "\n")
TYPES.register(get_types_from_msg(OWN, message.TYPE))


# The first call has rosbags write its own decoder.
@given(
    st.integers(0, message.MAX_TIME_NS - 1),
    st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=20),
    st.binary(max_size=50),
    st.sampled_from(["h264", "h265"]),
)
def test_an_independent_reader_finds_the_same(
    captured_ns: int, frame_id: str, unit: bytes, codec: str
) -> None:
    encoded = message.encode(captured_ns, frame_id, unit, codec)
    found = TYPES.deserialize_cdr(encoded, message.TYPE)
    assert found.timestamp.sec * 1_000_000_000 + found.timestamp.nanosec == captured_ns  # type: ignore[attr-defined]
    assert (found.frame_id, found.data.tobytes(), found.format) == (frame_id, unit, codec)  # type: ignore[attr-defined]
    assert TYPES.serialize_cdr(found, message.TYPE) == encoded


def test_the_bytes_of_one() -> None:
    assert message.encode(1_000_000_002, "ab", b"xyz", "h264") == bytes.fromhex(
        "00010000 01000000 02000000 03000000 616200 00 03000000 78797a 00 05000000 6832363400"
    )


def test_the_schema_contains_the_types_it_uses() -> None:
    assert OTHERS.splitlines()[0] == "MSG: builtin_interfaces/Time"
    registered = get_types_from_msg("\n".join(OTHERS.splitlines()[1:]), "builtin_interfaces/msg/Time")
    assert registered["builtin_interfaces/msg/Time"] == TYPES.fielddefs["builtin_interfaces/msg/Time"]


@pytest.mark.parametrize("field", ["timestamp", "frame_id", "data", "format"])
def test_the_schema_names_its_fields(field: str) -> None:
    assert f" {field}\n" in OWN
