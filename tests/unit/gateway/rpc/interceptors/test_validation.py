"""Requests that can't be parsed are refused as such, whichever parser notices."""

from types import SimpleNamespace
from typing import Any

import pytest

from common.errors import InvalidRequestError
from gateway.rpc.calls.methods import CONTRACT, Method
from gateway.rpc.interceptors.validation import Validation


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"\xff",
        # A group with field number 0, which does not exist: the first parser keeps it as unknown.
        b"\x63\x00\x00\x64",
    ],
    ids=["no message", "field number 0"],
)
def test_what_can_not_be_parsed_is_an_invalid_request(request_bytes: bytes) -> None:
    call: Any = SimpleNamespace(method=Method(f"/{CONTRACT.full_name}/SetPreviewMode"), request=None)
    with pytest.raises(InvalidRequestError, match=r"can't be parsed as .*SetPreviewModeRequest"):
        Validation(1000).on_request(call, request_bytes)
