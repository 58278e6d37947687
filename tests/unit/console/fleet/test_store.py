"""Which URLs of a receiver are used, and what answers of a store mean."""

from types import SimpleNamespace
from typing import Any

import pytest

from console.client.errors import GatewayError, GatewayFailed, Overloaded, Refused, Unreachable
from console.client.results import RecordingFile
from console.fleet.fetching import tls_context
from console.fleet.store import StoreStream, usable

FILE = RecordingFile(name="a", size=100, sha256=b"s" * 32, final=True)


@pytest.mark.parametrize(
    "url",
    [
        "https://store.example/bucket/key?X-Amz-Signature=1",
        "https://store.example:9000/key",
        "https://[2001:db8::1]:9000/key",
        "http://127.0.0.1:9000/key",
        "http://[::1]/key",
    ],
)
def test_stores_with_tls_and_those_of_this_computer(url: str) -> None:
    assert usable(url).geturl() == url


@pytest.mark.parametrize(
    "url",
    [
        "",
        "http://store.example/key",
        "http://127.0.0.1.example/key",
        "http://localhost@store.example/key",
        "https://anna:secret@store.example/key",
        "https:///key",
        "https://store.example:port/key",
        "https://store.example:99999/key",
        "https://[store/key",
        "https://store.example/key\r\nHost: other",
        "https://store.example/a key",
        "https://störe.example/key",
        "https://store.example/" + "k" * 9000,
        "file:///etc/passwd",
        "ftp://store.example/key",
    ],
)
def test_other_urls_are_not_opened(url: str) -> None:
    with pytest.raises(GatewayFailed):
        usable(url)


class Forgotten:
    """URLs, and which of them were forgotten."""

    def __init__(self) -> None:
        self.names: list[str] = []

    async def url(self, name: str) -> str:
        raise AssertionError(name)

    def forget(self, name: str) -> None:
        self.names.append(name)


@pytest.mark.parametrize(
    ("offset", "status", "length", "error", "renewed"),
    [
        (0, 200, 100, None, False),
        (40, 206, 60, None, False),
        (0, 200, 99, Refused, False),
        (40, 206, 100, Refused, False),
        # It ignores where to begin.
        (40, 200, 100, Refused, False),
        (0, 206, 100, Refused, False),
        (0, 200, None, Refused, False),
        (0, 301, 0, Refused, False),
        (0, 307, 100, Refused, False),
        (40, 416, 0, Refused, False),
        (0, 404, 10, Refused, False),
        (0, 429, 10, Overloaded, False),
        (0, 503, 10, Overloaded, False),
        (0, 403, 10, Unreachable, True),
        (0, 500, 10, Unreachable, True),
    ],
)
def test_what_an_answer_means(
    offset: int, status: int, length: int | None, error: type[GatewayError] | None, *, renewed: bool
) -> None:
    urls = Forgotten()
    stream = StoreStream(FILE, offset, urls, tls_context(None))
    answer: Any = SimpleNamespace(status=status, length=length)
    if error is None:
        stream.check(answer)
    else:
        with pytest.raises(error) as caught:
            stream.check(answer)
        assert type(caught.value) is error
    assert urls.names == (["a"] if renewed else [])
