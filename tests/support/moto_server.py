"""moto's server, with the instants at which uploads were begun: to moto, all of them were in 2010.

Receivers delete parts of uploads that were begun long ago, at every start. With moto's date, a receiver that
starts ended the uploads of all others.
"""

import functools
from datetime import UTC, datetime
from typing import Any

import moto.s3.responses
from moto.s3.models import FakeMultipart
from moto.server import main

_begun: dict[str, datetime] = {}
"""By the upload's ID."""
_initialise = FakeMultipart.__init__
_responses: Any = moto.s3.responses
_result = _responses.ActionResult


@functools.wraps(_initialise)
def _begin(self: FakeMultipart, *args: Any, **kwargs: Any) -> None:
    _initialise(self, *args, **kwargs)
    _begun[self.id] = datetime.now(UTC)


def _dated(result: Any) -> Any:
    for upload in result.get("Uploads", ()) if isinstance(result, dict) else ():
        upload["Initiated"] = _begun[upload["UploadId"]].isoformat()
    return _result(result)


if __name__ == "__main__":
    FakeMultipart.__init__ = _begin  # type: ignore[method-assign]
    _responses.ActionResult = _dated
    main()
