"""NAL units of both codecs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.receiver import clips
from recorder.video.access_unit import Codec, Content, content


def unit(*types: int, codec: Codec = Codec.H264) -> bytes:
    shift = 0 if codec is Codec.H264 else 1
    return b"".join(b"\0\0\0\1" + bytes([each << shift]) + b"\x42" * 5 for each in types)


@pytest.mark.parametrize(
    ("types", "expected"),
    [
        ((9, 7, 8, 5), Content(intra=True, parameter_sets=True)),
        ((9, 5), Content(intra=True, parameter_sets=False)),
        ((7, 5), Content(intra=True, parameter_sets=False)),
        ((7, 8, 1), Content(intra=False, parameter_sets=True)),
        ((1,), Content(intra=False, parameter_sets=False)),
    ],
)
def test_h264(types: tuple[int, ...], expected: Content) -> None:
    assert content(Codec.H264, unit(*types)) == expected
    assert expected.decodable is (types == (9, 7, 8, 5))


@pytest.mark.parametrize("picture", [16, 19, 20, 21])
def test_h265(picture: int) -> None:
    assert content(Codec.H265, unit(32, 33, 34, picture, codec=Codec.H265)).decodable
    assert not content(Codec.H265, unit(33, 34, picture, codec=Codec.H265)).decodable
    assert not content(Codec.H265, unit(32, 33, 34, 1, codec=Codec.H265)).decodable


@pytest.mark.parametrize("codec", Codec)
def test_units_of_a_real_encoder(codec: Codec) -> None:
    first, *others = list(clips.units(codec.value))
    assert content(codec, first).decodable
    assert not any(content(codec, each).intra for each in others)


@given(st.sampled_from(Codec), st.binary(max_size=200))
def test_any_bytes_have_a_content(codec: Codec, data: bytes) -> None:
    content(codec, data)


@pytest.mark.parametrize("data", [b"", b"\0\0\1", b"\0\0\0\1"])
def test_without_a_nal_unit_there_is_nothing(data: bytes) -> None:
    assert content(Codec.H264, data) == Content(intra=False, parameter_sets=False)
