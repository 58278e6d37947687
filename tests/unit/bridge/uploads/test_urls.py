"""A hub's URLs lead only to the store of the enrolment: no other host, no other scheme, nothing hidden."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.config import UploadSettings
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


@pytest.mark.parametrize(
    ("path", "accepted"),
    [
        ("/lab-recordings/lab/r1/one/data%20a.bin?uploadId=x", True),
        ("/lab-recordings/..a/key", True),
        ("/other/key", False),
        ("/lab-recordings-evil/key", False),
        ("/lab-recordings", False),
        ("//lab-recordings/key", False),
        ("/lab-recordings/../other/key", False),
        ("/lab-recordings/./key", False),
        ("/lab-recordings/%2e%2E/other/key", False),
        ("/lab-recordings/%2e%2e%5cother/key", False),
        ("/lab-recordings/a%2F..%2F..%2Fother/key", False),
    ],
)
def test_where_others_have_buckets_only_the_named_one_is_sent_to(path: str, *, accepted: bool) -> None:
    settings = UploadSettings(store_hosts=("s3.example/lab-recordings",))
    assert settings.hosts == ("s3.example",)
    if accepted:
        assert checked_url(f"https://s3.example{path}", settings)
    else:
        with pytest.raises(CutError, match="nothing was sent"):
            checked_url(f"https://s3.example{path}", settings)


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
