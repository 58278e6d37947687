"""Something else answers in the store's place: the page of a proxy, or XML that is none of S3."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from hub.receiver.config import StoreSettings
from hub.receiver.store import Store, StoreError, StoreProblem

PARTS = b"<ListPartsResult><Part><PartNumber>x</PartNumber></Part></ListPartsResult>"
OBJECTS = b"<ListBucketResult><Contents><Size>x</Size></Contents></ListBucketResult>"
UPLOADS = (
    b"<ListMultipartUploadsResult><Upload><Initiated>x</Initiated></Upload></ListMultipartUploadsResult>"
)
BODIES = [b"<html><p>This network requires a login", b"<a/>", b"", b"\xff\x00", PARTS, OBJECTS, UPLOADS]
CALLS: dict[str, Callable[[Store], Any]] = {
    "find": lambda store: store.find("key"),
    "sizes": lambda store: store.sizes("key", 10),
    "open_upload": lambda store: store.open_upload("key"),
    "parts": lambda store: store.parts("key", "upload"),
    "open_uploads": lambda store: list(store.open_uploads("")),
}


@contextmanager
def always(body: bytes) -> Iterator[str]:
    """A server that answers 200 and these bytes to everything; yields its URL."""

    class Answers(BaseHTTPRequestHandler):
        def answer(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(body)

        do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = answer  # noqa: N815  # the library names them

        def log_message(self, *_: Any) -> None:
            """Says nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Answers) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(params=BODIES, ids=["html", "xml", "empty", "bytes", "parts", "objects", "uploads"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    secret = tmp_path / "secret"
    secret.write_text("test\n", encoding="ascii")
    with always(request.param) as url:
        store = Store(StoreSettings(endpoint=url, bucket="bucket", access_key="test", secret_key_file=secret))
        try:
            yield store
        finally:
            store.close()


@pytest.mark.parametrize("call", CALLS)
def test_an_answer_that_is_none_is_an_error_of_the_store(store: Store, call: str) -> None:
    with suppress(StoreError):
        assert not CALLS[call](store), "nothing is found in it"


def test_no_upload_is_begun_without_an_id(store: Store) -> None:
    for call in ("find", "open_upload"):
        with pytest.raises(StoreError) as error:
            CALLS[call](store)
        assert error.value.problem is StoreProblem.REFUSED
