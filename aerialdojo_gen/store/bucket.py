"""Requests to an S3 bucket: get, put, list, delete and conditional puts, tried again where that helps.

Credentials, region, endpoint, retries and checksums are configured as for every AWS tool: by environment variables
and by the files that `aws configure` writes, never by the URL. What asking again cannot mend becomes one line that
names the URL and the mend.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from email.utils import parsedate_to_datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from aerialdojo_gen.base.environment_errors import number_of
from aerialdojo_gen.base.errors import MissingPackage, StoreError, first_line, no_package

# A file of more bytes goes up in parts, several at a time; S3 takes 10,000 of them at most.
_SINGLE, _PART, _MAX_PARTS, AT_ONCE = 16 << 20, 8 << 20, 9_000, 4
_BLOCK = 1 << 20
_TRIES = 6
# A connection that is silent for so long is given up and made anew, unless ``$AERIALDOJO_TIMEOUT_S`` says otherwise:
# well below the time that a lock holds.
_SILENT_S = 15.0
Write = Callable[[bytes], object]

_KEPT = "what was finished is kept, nothing half-written"
_CREDENTIALS = (
    "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY (and AWS_SESSION_TOKEN where they are temporary), "
    "or AWS_PROFILE, or run aws configure"
)
_MISSING = {"NoSuchKey", "404", "NotFound"}
_CHANGED = {"PreconditionFailed", "412", "ConditionalRequestConflict", "409"}
_BUSY = {
    "SlowDown", "503", "ServiceUnavailable", "InternalError", "500", "502", "504", "RequestTimeout", "Throttling",
    "ThrottlingException", "RequestLimitExceeded", "BandwidthLimitExceeded", "OperationAborted",
}  # fmt: skip
_UNREACHABLE = {
    "EndpointConnectionError", "ConnectTimeoutError", "ReadTimeoutError", "ConnectionClosedError", "SSLError",
    "ProxyConnectionError", "HTTPClientError", "ConnectionError", "ResponseStreamingError", "IncompleteReadError",
}  # fmt: skip
# Names of the client's errors or codes that stores answer with, and what each means.
_EXPLAINED = (
    ({"NoCredentialsError", "PartialCredentialsError", "CredentialRetrievalError", "NoAuthTokenError"},
     f"there are no credentials: {_CREDENTIALS}"),
    ({"TokenRetrievalError", "SSOTokenLoadError", "UnauthorizedSSOTokenError"},
     "the session has expired: run aws sso login, or set other credentials"),
    ({"ProfileNotFound"},
     "there is no AWS profile of the name that AWS_PROFILE says: correct it, or run aws configure"),
    ({"InvalidAccessKeyId", "SignatureDoesNotMatch", "ExpiredToken", "InvalidToken", "TokenRefreshRequired"},
     f"the store refuses the credentials ({{code}}): {_CREDENTIALS}"),
    ({"NoSuchBucket"}, "there is no bucket {bucket!r} at {endpoint}: make it, or correct --data"),
    ({"AccessDenied", "403", "Forbidden", "AllAccessDisabled", "AccountProblem"},
     "access is denied: the credentials need s3:ListBucket, s3:GetObject, s3:PutObject, s3:DeleteObject and "
     "s3:AbortMultipartUpload there"),
    ({"PermanentRedirect", "301", "AuthorizationHeaderMalformed", "IllegalLocationConstraintException"},
     "the bucket is of another region: set AWS_DEFAULT_REGION to it"),
    (_BUSY, f"the store keeps answering {{code}}: run the command again later; {_KEPT}"),
    (_UNREACHABLE,
     "{endpoint} cannot be reached, does not answer or drops the connection: check the network and "
     f"AWS_ENDPOINT_URL, and run the command again; {_KEPT}"),
)  # fmt: skip


class Changed(Exception):  # noqa: N818 - it says what happened
    """An object is no longer, or not yet, the one that a request was for."""


def code_of(error: BaseException) -> str:
    """Return the code that the store answered with; empty where it did not answer."""
    response: Any = getattr(error, "response", None)
    return str(response.get("Error", {}).get("Code", "")) if isinstance(response, dict) else ""


def is_transient(error: BaseException) -> bool:
    """Whether to ask again may help."""
    return bool(_kinds(error) & (_BUSY | _UNREACHABLE)) or isinstance(error, OSError)


def _kinds(error: BaseException) -> set[str]:
    return {code_of(error), *(kind.__name__ for kind in type(error).__mro__)}


def cloud_error(error: Exception, url: str, endpoint: str | None) -> Exception | None:
    """Return what to raise for an error of the client; None where it is a defect of ours."""
    code, kinds = code_of(error), _kinds(error)
    if code in _MISSING:
        return FileNotFoundError(2, "no such object", url)
    if code in _CHANGED:
        return Changed(url)
    for known, why in _EXPLAINED:
        if kinds & known:
            bucket = url.removeprefix("s3://").partition("/")[0]
            return StoreError(f"{url}: {why.format(code=code, bucket=bucket, endpoint=endpoint)}")
    if code:
        return StoreError(f"{url}: the store refuses ({first_line(error)}); {_KEPT}")
    if kinds & {"BotoCoreError", "ValueError"}:
        return StoreError(f"{url}: {first_line(error)}: correct the AWS configuration or --data")
    if isinstance(error, OSError):
        return StoreError(f"{url}: {error.strerror or first_line(error)}; {_KEPT}")
    return None


class Entry(NamedTuple):
    """An object as a listing has it: bytes, and the tag that changes with them."""

    size: int
    etag: str


class Content(NamedTuple):
    """A small object, read whole; `age_s` is the time since it was written, by the store's own clock."""

    data: bytes
    etag: str
    age_s: float


class Bucket:
    """A bucket of an S3 store."""

    def __init__(self, name: str) -> None:
        self.name = name
        with _making:
            self._client = _made_client(os.getpid())
        self.endpoint = str(self._client.meta.endpoint_url)

    def read_small(self, key: str) -> Content:
        """Read an object with its tag and its age."""
        with self._location(key):
            answer = self._client.get_object(Bucket=self.name, Key=key)
            data = answer["Body"].read()
        date = answer["ResponseMetadata"]["HTTPHeaders"].get("date")
        now = parsedate_to_datetime(date).timestamp() if date else time.time()
        return Content(data, answer["ETag"], now - float(answer["LastModified"].timestamp()))

    def download(self, key: str, write: Write, entry: Entry, begin: int = 0, end: int | None = None) -> None:
        """Give an object's blocks, or a part's, to a function; where the connection drops, the rest is asked for."""
        at, end = begin, entry.size if end is None else end
        for tries in range(_TRIES):
            if at >= end:
                return
            if tries:
                time.sleep(min(0.1 * 2.0**tries, 10.0))
            # Of a whole object the client compares the checksum that the store has of it.
            part = {} if (at, end) == (0, entry.size) else {"Range": f"bytes={at}-{end - 1}"}
            with self._location(key):
                # The client itself tries again until an answer begins; what breaks off later is tried again here.
                answer = self._client.get_object(Bucket=self.name, Key=key, IfMatch=entry.etag, **part)
                try:
                    for block in answer["Body"].iter_chunks(_BLOCK):
                        write(block)
                        at += len(block)
                except Exception as error:
                    if not is_transient(error) or tries + 1 == _TRIES:
                        raise
        if at < end:
            raise StoreError(f"s3://{self.name}/{key} ends at {at:,} bytes of {end:,}: run the command again")

    def head(self, key: str) -> tuple[Entry, Mapping[str, str]]:
        """Return an object's entry, and what was said with it when it was put."""
        with self._location(key):
            answer = self._client.head_object(Bucket=self.name, Key=key)
        return Entry(answer["ContentLength"], answer["ETag"]), answer.get("Metadata", {})

    def put(self, key: str, path: Path, metadata: Mapping[str, str]) -> Entry:
        """Put a file as an object: it is there whole or not at all, also where this process is killed."""
        size = path.stat().st_size
        with self._location(key):
            if size > _SINGLE:
                return Entry(size, self._put_parts(key, path, size, metadata))
            with path.open("rb") as file:
                answer = self._client.put_object(Bucket=self.name, Key=key, Body=file, Metadata=dict(metadata))
            return Entry(size, answer["ETag"])

    def _put_parts(self, key: str, path: Path, size: int, metadata: Mapping[str, str], tries: int = 3) -> str:
        length = max(_PART, -(-size // _MAX_PARTS))
        where = {"Bucket": self.name, "Key": key}
        where["UploadId"] = self._client.create_multipart_upload(**where, Metadata=dict(metadata))["UploadId"]

        def put_part(number: int) -> dict[str, Any]:
            with path.open("rb") as file:
                file.seek((number - 1) * length)
                part = self._client.upload_part(**where, PartNumber=number, Body=file.read(length))
            return {"PartNumber": number, "ETag": part["ETag"]}

        try:
            with ThreadPoolExecutor(AT_ONCE) as pool:
                parts = list(pool.map(put_part, range(1, -(-size // length) + 1)))
            done = self._client.complete_multipart_upload(**where, MultipartUpload={"Parts": parts})
        except BaseException as error:
            with suppress(Exception):
                self._client.abort_multipart_upload(**where)
            if code_of(error) == "NoSuchUpload" and tries > 1:
                # A run that holds another part of the bucket took our upload for one that was left.
                return self._put_parts(key, path, size, metadata, tries - 1)
            raise
        return str(done["ETag"])

    def put_bytes(self, key: str, data: bytes, *, new: bool = False, etag: str = "") -> Entry:
        """Put a small object; only where there is none (`new`), or where its tag is the one given."""
        condition = {"IfNoneMatch": "*"} if new else {"IfMatch": etag} if etag else {}
        with self._location(key):
            answer = self._client.put_object(Bucket=self.name, Key=key, Body=data, **condition)
        return Entry(len(data), answer["ETag"])

    def copy(self, key: str, to: str) -> Entry:
        """Copy an object inside the store."""
        source = {"Bucket": self.name, "Key": key}
        with self._location(to):
            size = self._client.head_object(**source)["ContentLength"]
            answer = self._client.copy_object(Bucket=self.name, Key=to, CopySource=source, MetadataDirective="COPY")
        return Entry(size, answer["CopyObjectResult"]["ETag"])

    def list(self, prefix: str) -> dict[str, Entry]:
        """Return the objects whose keys begin with a prefix, by key."""
        return {
            item["Key"]: Entry(item["Size"], item["ETag"])
            for page in self._pages("list_objects_v2", prefix)
            for item in page.get("Contents", [])
        }

    def list_names(self, prefix: str) -> Iterator[str]:
        """Yield what lies right below a prefix, objects and folders, without their contents."""
        for page in self._pages("list_objects_v2", prefix, Delimiter="/"):
            yield from (item["Key"].removeprefix(prefix) for item in page.get("Contents", []))
            yield from (item["Prefix"].removeprefix(prefix).rstrip("/") for item in page.get("CommonPrefixes", []))

    def delete(self, keys: Sequence[str]) -> None:
        """Remove objects; those that are not there are no error."""
        for begin in range(0, len(keys), 1000):
            batch = keys[begin : begin + 1000]
            objects = {"Objects": [{"Key": key} for key in batch], "Quiet": True}
            with self._location(batch[0]):
                answer = self._client.delete_objects(Bucket=self.name, Delete=objects)
            for failed in answer.get("Errors", []):
                raise StoreError(f"cannot delete s3://{self.name}/{failed.get('Key')}: {failed.get('Message')}")

    def abort_uploads(self, prefix: str) -> None:
        """Abort the uploads in parts under a prefix that nobody completed."""
        for page in self._pages("list_multipart_uploads", prefix):
            for upload in page.get("Uploads", []):
                where = {"Bucket": self.name, "Key": upload["Key"], "UploadId": upload["UploadId"]}
                with self._location(upload["Key"]), suppress(self._client.exceptions.NoSuchUpload):
                    self._client.abort_multipart_upload(**where)

    def _pages(self, request: str, prefix: str, **parameters: Any) -> Iterator[dict[str, Any]]:
        with self._location(prefix):
            yield from self._client.get_paginator(request).paginate(Bucket=self.name, Prefix=prefix, **parameters)

    @contextmanager
    def _location(self, key: str) -> Iterator[None]:
        """Turn what the client raises into one line, FileNotFoundError or `Changed`."""
        url = f"s3://{self.name}/{key}"
        try:
            yield
        except (StoreError, FileNotFoundError, Changed):
            raise
        except Exception as error:
            if (translated := cloud_error(error, url, self.endpoint)) is not None:
                raise translated from error
            raise


# Clients may be shared by threads, sessions that make them may not.
_making = threading.Lock()


@lru_cache(maxsize=1)
def _made_client(_process: int) -> Any:
    try:
        import botocore.session
        from botocore.config import Config
    except ImportError:
        raise MissingPackage(no_package("s3://", "botocore", "cloud")) from None
    retries: dict[str, Any] = {} if "AWS_RETRY_MODE" in os.environ else {"mode": "standard"}
    if "AWS_MAX_ATTEMPTS" not in os.environ:
        retries["total_max_attempts"] = _TRIES
    # Stores other than AWS's have one host name for all buckets.
    endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL")
    silent_s = number_of("AERIALDOJO_TIMEOUT_S", _SILENT_S, 0.1, 3600.0, "write a number of seconds from 0.1 to 3600")
    config = Config(
        retries=retries or None, connect_timeout=silent_s, read_timeout=silent_s, max_pool_connections=2 * AT_ONCE,
        s3={"addressing_style": "path"} if endpoint else None,
    )  # fmt: skip
    try:
        return botocore.session.Session().create_client("s3", config=config)
    except Exception as error:
        if (translated := cloud_error(error, "s3://", endpoint)) is not None:
            raise translated from error
        raise
