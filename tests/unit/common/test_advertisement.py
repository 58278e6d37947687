"""What an advertisement says, and what is read from one that is damaged or hostile."""

from hypothesis import example, given
from hypothesis import strategies as st

from common.advertisement import Advertisement, advertisement_from


def as_received(properties: dict[str, str]) -> dict[bytes, bytes | None]:
    return {key.encode(): value.encode() for key, value in properties.items()}


def test_what_is_announced_is_read() -> None:
    for tls in (True, False):
        announced = Advertisement("lab ü", "omniseer.gateway.v1", tls)
        assert advertisement_from(as_received(announced.properties())) == announced


def test_each_string_fits_a_txt_record() -> None:
    for key, value in Advertisement("ü" * 300, "x" * 300, True).properties().items():
        assert len(f"{key}={value}".encode()) <= 255


@given(
    st.dictionaries(
        st.sampled_from([b"name", b"contract", b"tls", b"x"]), st.none() | st.binary(max_size=500)
    )
)
@example({b"tls": b"1\x80"})
def test_anything_can_be_read_and_is_bounded(properties: dict[bytes, bytes | None]) -> None:
    read = advertisement_from(properties)
    assert max(len(read.name), len(read.contract)) <= 200
    assert read.tls is (properties.get(b"tls") == b"1")
