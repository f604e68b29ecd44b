"""What an object store's client raises, as one line that names the URL and the mend."""

from __future__ import annotations

from typing import Any

from aerialdojo_gen.base.errors import StoreError, first_line

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
