"""The S3-compatible store; the one home of boto3. Blocking: it is called from threads.

Every call has the library's deadlines (5 s to connect, 30 s without a byte) and is repeated twice at most.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from itertools import islice
from typing import TYPE_CHECKING, Any, Final

import boto3
from botocore.config import Config
from botocore.exceptions import BotoCoreError, ClientError, HTTPClientError
from botocore.parsers import ResponseParserError

from common.errors import UserError
from hub.receiver.config import StoreSettings
from hub.receiver.keys import RECORDING

if TYPE_CHECKING:
    from types_boto3_s3 import S3Client

PART_BYTES: Final = 8 * 1024 * 1024
URL_VALID_S: Final = 900
_READ_BYTES: Final = 1024 * 1024
CONNECTIONS: Final = 16
MOST_PARTS: Final = 10_000
"""Of one file: what S3 permits of a multipart upload."""
_SECRET_BYTES: Final = 1024
_NO_ROOM: Final = frozenset(
    {"QuotaExceeded", "XMinioStorageFull", "InsufficientStorage", "StorageFull", "EntityTooLarge", "507"}
)
_MISSING: Final = frozenset({"NoSuchKey", "NoSuchUpload", "404", "InvalidPart", "InvalidPartOrder"})
_CHANGED: Final = frozenset({"PreconditionFailed", "ConditionalRequestConflict", "412"})
_NO_CONDITIONS: Final = "NotImplemented"
"""Of a store that knows no conditions of this request."""


class StoreProblem(Enum):
    """Why the store did not do what it was requested to."""

    NO_ROOM = "no room"
    MISSING = "missing"
    """It has no such object, upload or part."""
    CHANGED = "changed"
    """It has another object there by now."""
    REFUSED = "refused"
    """It refuses, or does not answer."""


class StoreError(Exception):
    """The store did not do what it was requested to.

    Args:
        problem: Why, for programs.
        text: Why, for people; nothing of the store's addresses or keys.
    """

    def __init__(self, problem: StoreProblem, text: str) -> None:
        super().__init__(text)
        self.problem = problem


@dataclass(frozen=True, slots=True)
class StoredObject:
    """An object in the store; its entity tag changes with its content."""

    size: int
    etag: str


@dataclass(frozen=True, slots=True)
class StoredPart:
    """A part of an upload that is not completed."""

    number: int
    etag: str
    size: int


@dataclass(frozen=True, slots=True)
class OpenUpload:
    """An upload that is not completed."""

    key: str
    upload_id: str
    begun: datetime


class Store:
    """One bucket.

    Args:
        settings: Where it is.

    Raises:
        UserError: The file of the secret can't be read, or the endpoint is none.
    """

    def __init__(self, settings: StoreSettings) -> None:
        self._bucket = settings.bucket
        self._client = _client(settings, settings.endpoint)
        # URLs for robots are only signed, never opened here.
        self._signing = _client(settings, settings.public_endpoint or settings.endpoint)

    def location(self, key: str) -> str:
        """Returns where an object is, for receipts."""
        return f"s3://{self._bucket}/{key}"

    def find(self, key: str) -> StoredObject | None:
        """Returns an object without its content; None if there is none."""
        try:
            with _problems():
                found = self._client.head_object(Bucket=self._bucket, Key=key)
                return StoredObject(found["ContentLength"], found["ETag"])
        except StoreError as error:
            if error.problem is StoreProblem.MISSING:
                return None
            raise

    def read(self, key: str, most: int) -> bytes | None:
        """Returns a small object; None if there is none, or it has more bytes than `most`."""
        try:
            with _problems():
                body = self._client.get_object(Bucket=self._bucket, Key=key)["Body"]
                content = body.read(most + 1)
                body.close()
        except StoreError as error:
            if error.problem is StoreProblem.MISSING:
                return None
            raise
        return content if len(content) <= most else None

    def stream(self, key: str, etag: str) -> Iterator[bytes]:
        """Yields the content of an object, as long as it is the one with that entity tag."""
        with _problems():
            body = self._client.get_object(Bucket=self._bucket, Key=key, IfMatch=etag)["Body"]
            try:
                yield from body.iter_chunks(_READ_BYTES)
            finally:
                body.close()

    def write(self, key: str, content: bytes) -> None:
        """Writes a small object, in place of any other."""
        with _problems():
            self._client.put_object(Bucket=self._bucket, Key=key, Body=content)

    def create(self, key: str) -> None:
        """Writes an empty object, unless there is one."""
        try:
            with _problems():
                _if(self._client.put_object, {"IfNoneMatch": "*"}, Bucket=self._bucket, Key=key, Body=b"")
        except StoreError as error:
            if error.problem is not StoreProblem.CHANGED:
                raise

    def delete(self, key: str, etag: str) -> None:
        """Deletes an object, as long as it is the one with that entity tag."""
        with _problems():
            _if(self._client.delete_object, {"IfMatch": etag}, Bucket=self._bucket, Key=key)

    def sizes(self, prefix: str, most: int) -> dict[str, int]:
        """Returns the sizes of objects by key, so many at most."""
        with _problems():
            pages = self._client.get_paginator("list_objects_v2").paginate(Bucket=self._bucket, Prefix=prefix)
            found = (each for page in pages for each in page.get("Contents", []))
            return {each["Key"]: each["Size"] for each in islice(found, most)}

    def recordings(self, prefix: str) -> Iterator[tuple[str, str]]:
        """Yields the robot and the ID of each recording of a fleet, "lab/", that was completed."""
        with _problems():
            paginator = self._client.get_paginator("list_objects_v2")
            # Level by level: the files of the recordings, millions perhaps, are not listed.
            for robots in paginator.paginate(Bucket=self._bucket, Prefix=prefix, Delimiter="/"):
                for robot in robots.get("CommonPrefixes", []):
                    place = robot["Prefix"]
                    for page in paginator.paginate(Bucket=self._bucket, Prefix=place, Delimiter="/"):
                        for each in page.get("Contents", []):
                            name = each["Key"].removeprefix(place)
                            if name.endswith(RECORDING):
                                yield place.removeprefix(prefix).rstrip("/"), name.removesuffix(RECORDING)

    def open_upload(self, key: str) -> str:
        """Returns the ID of the upload of a key: the oldest that is not completed, or a new one."""
        with _problems():
            page = self._client.list_multipart_uploads(Bucket=self._bucket, Prefix=key)
            begun = [each for each in page.get("Uploads", []) if each.get("Key") == key]
            if begun:
                # Two receivers find the same one, whichever of them began it.
                oldest = min(begun, key=lambda each: (each["Initiated"], each["UploadId"]))
                return oldest["UploadId"]
            return self._client.create_multipart_upload(Bucket=self._bucket, Key=key)["UploadId"]

    def parts(self, key: str, upload_id: str) -> list[StoredPart]:
        """Returns the parts of an upload that the store has, in order."""
        with _problems():
            pages = self._client.get_paginator("list_parts").paginate(
                Bucket=self._bucket, Key=key, UploadId=upload_id
            )
            found = (part for page in pages for part in page.get("Parts", []))
            parts = [
                StoredPart(part["PartNumber"], part["ETag"], part["Size"])
                for part in islice(found, MOST_PARTS)
            ]
        return sorted(parts, key=lambda part: part.number)

    def part_url(self, key: str, upload_id: str, number: int, size: int) -> str:
        """Returns a URL to which so many bytes can be PUT, as this part alone, for URL_VALID_S."""
        with _problems():
            return self._signing.generate_presigned_url(
                "upload_part",
                Params={
                    "Bucket": self._bucket,
                    "Key": key,
                    "UploadId": upload_id,
                    "PartNumber": number,
                    "ContentLength": size,
                },
                ExpiresIn=URL_VALID_S,
            )

    def file_url(self, key: str) -> str:
        """Returns a URL from which an object can be read, and this one alone, for URL_VALID_S."""
        with _problems():
            return self._signing.generate_presigned_url(
                "get_object", Params={"Bucket": self._bucket, "Key": key}, ExpiresIn=URL_VALID_S
            )

    def complete(self, key: str, upload_id: str, parts: Sequence[tuple[int, str]]) -> None:
        """Puts parts, each with its number and entity tag, together to an object, unless there is one."""
        with _problems():
            _if(
                self._client.complete_multipart_upload,
                {"IfNoneMatch": "*"},
                Bucket=self._bucket,
                Key=key,
                UploadId=upload_id,
                MultipartUpload={"Parts": [{"PartNumber": number, "ETag": etag} for number, etag in parts]},
            )

    def open_uploads(self, prefix: str) -> Iterator[OpenUpload]:
        """Yields the uploads that are not completed."""
        with _problems():
            pages = self._client.get_paginator("list_multipart_uploads").paginate(
                Bucket=self._bucket, Prefix=prefix
            )
            for page in pages:
                for each in page.get("Uploads", []):
                    yield OpenUpload(each["Key"], each["UploadId"], each["Initiated"])

    def abort(self, upload: OpenUpload) -> None:
        """Deletes an upload and its parts; another receiver may have done so."""
        try:
            with _problems():
                self._client.abort_multipart_upload(
                    Bucket=self._bucket, Key=upload.key, UploadId=upload.upload_id
                )
        except StoreError as error:
            if error.problem is not StoreProblem.MISSING:
                raise

    def close(self) -> None:
        """Closes its connections."""
        self._client.close()
        self._signing.close()


@contextmanager
def _problems() -> Iterator[None]:
    """Turns the library's errors into a `StoreError`."""
    try:
        yield
    except ClientError as error:
        code = _code(error)
        if code in _CHANGED:
            raise StoreError(StoreProblem.CHANGED, "the store has another object there by now") from error
        if code in _NO_ROOM:
            raise StoreError(StoreProblem.NO_ROOM, "the store has no room") from error
        if code in _MISSING:
            raise StoreError(StoreProblem.MISSING, f"the store does not have it ({code})") from error
        raise StoreError(StoreProblem.REFUSED, f"the store refuses ({code[:64]})") from error
    except (BotoCoreError, HTTPClientError, OSError) as error:
        text = f"the store does not answer ({type(error).__name__})"
        raise StoreError(StoreProblem.REFUSED, text) from error
    except (ResponseParserError, KeyError, ValueError) as error:
        # A page of a proxy in its place, for example.
        raise StoreError(StoreProblem.REFUSED, "the store's answer makes no sense") from error


def _if(call: Callable[..., Any], condition: dict[str, str], **request: Any) -> None:
    """Calls with a condition; without it where the store knows none, and the looks before have to do."""
    try:
        call(**request, **condition)
    except ClientError as error:
        if _code(error) != _NO_CONDITIONS:
            raise
        call(**request)


def _code(error: ClientError) -> str:
    return str(error.response.get("Error", {}).get("Code", ""))


def _client(settings: StoreSettings, endpoint: str | None) -> "S3Client":
    try:
        secret = settings.secret_key_file.read_bytes()[:_SECRET_BYTES].decode("ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(
            f"the store's secret key {settings.secret_key_file} can't be read: {error}",
            "Correct store.secret_key_file",
        ) from error
    try:
        return boto3.client(
            "s3",
            endpoint_url=endpoint,
            region_name=settings.region,
            aws_access_key_id=settings.access_key,
            aws_secret_access_key=secret,
            verify=str(settings.ca) if settings.ca else None,
            config=Config(
                signature_version="s3v4",
                s3={"addressing_style": "path" if settings.path_style else "virtual"},
                connect_timeout=5,
                read_timeout=30,
                retries={"mode": "standard", "total_max_attempts": 3},
                max_pool_connections=CONNECTIONS,
                # Not every compatible store knows Amazon's checksums, which would be part of URLs.
                request_checksum_calculation="when_required",
                response_checksum_validation="when_required",
            ),
        )
    except (ValueError, BotoCoreError) as error:
        raise UserError(f"store.endpoint {endpoint} can't be used: {error}", "Correct it") from error
