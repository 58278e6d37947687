"""A hub's URLs lead only to the store of the enrolment: no other host, no other scheme, nothing hidden."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.uploads.config import UploadSettings
from bridge.uploads.parts import checked_url
from bridge.uploads.problems import CutError

SETTINGS = UploadSettings(store_hosts=("store.example", "store.example:9000"))
LOOPBACK = UploadSettings(store_hosts=("127.0.0.1:9000",), insecure_store=True)


@pytest.mark.parametrize(
    "url",
    [
        "https://store.example/bucket/key?X-Amz-Signature=a%2Fb",
        "https://store.example:9000/bucket/key",
        "https://STORE.example/bucket/key",
    ],
)
def test_the_store_s_own_is_accepted(url: str) -> None:
    assert str(checked_url(url, SETTINGS)).lower() == url.lower()


@pytest.mark.parametrize(
    "url",
    [
        "",
        "https://",
        "store.example/key",
        "http://store.example/key",
        "file:///etc/passwd",
        "https://192.168.0.1/key",
        "https://store.example:22/key",
        "https://store.example.evil/key",
        "https://store.example@evil/key",
        "https://user:secret@store.example/key",
        "https://evil\\@store.example/key",
        "https://store.example/key#fragment",
        "https://store.example/a\r\nHost: evil",
        "https://store.example/ key",
        "https://[::1]/key",
        "https://[::1/key",
        "https://store.example:99999/key",
        "https://store.example/" + "a" * 5000,
        "https://stör.example/key",
    ],
)
def test_anything_else_is_refused(url: str) -> None:
    with pytest.raises(CutError, match="nothing was sent"):
        checked_url(url, SETTINGS)


def test_without_tls_only_this_machine_and_only_where_configured() -> None:
    assert checked_url("http://127.0.0.1:9000/key", LOOPBACK)
    with pytest.raises(CutError):
        checked_url("http://127.0.0.1:9000/key", UploadSettings(store_hosts=("127.0.0.1:9000",)))


@given(st.text(max_size=60) | st.text(max_size=40).map(lambda text: f"https://store.example{text}"))
def test_no_text_gets_past(url: str) -> None:
    try:
        accepted = checked_url(url, SETTINGS)
    except CutError:
        return
    assert (accepted.scheme, accepted.host) == ("https", "store.example")
    assert accepted.port in {443, 9000}
    assert accepted.user is None
