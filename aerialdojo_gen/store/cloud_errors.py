"""What an object store's client raises, as one line that names the URL and the mend."""

from __future__ import annotations

from typing import Any

from aerialdojo_gen.base.errors import StoreError, first_line

_KEPT = "what was finished is kept, nothing half-written"
_CREDENTIALS = (
    "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY (and AWS_SESSION_TOKEN where they are temporary), "
    "or AWS_PROFILE, or run aws configure"
)
_NO_CREDENTIALS = {"NoCredentialsError", "PartialCredentialsError", "CredentialRetrievalError", "NoAuthTokenError"}
_OLD_CREDENTIALS = {"TokenRetrievalError", "SSOTokenLoadError", "UnauthorizedSSOTokenError"}
_REFUSED = {"InvalidAccessKeyId", "SignatureDoesNotMatch", "ExpiredToken", "InvalidToken", "TokenRefreshRequired"}
_DENIED = {"AccessDenied", "403", "Forbidden", "AllAccessDisabled", "AccountProblem"}
_ELSEWHERE = {"PermanentRedirect", "301", "AuthorizationHeaderMalformed", "IllegalLocationConstraintException"}
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


class Changed(Exception):  # noqa: N818 - it says what happened
    """An object is no longer, or not yet, the one that a request was for."""


def code_of(error: BaseException) -> str:
    """Return the code that the store answered with; empty where it did not answer."""
    response: Any = getattr(error, "response", None)
    return str(response.get("Error", {}).get("Code", "")) if isinstance(response, dict) else ""


def is_transient(error: BaseException) -> bool:
    """Whether to ask again may help."""
    return code_of(error) in _BUSY or bool(_names(error) & _UNREACHABLE) or isinstance(error, OSError)


def _names(error: BaseException) -> set[str]:
    return {kind.__name__ for kind in type(error).__mro__}


def cloud_error(error: Exception, url: str, endpoint: str | None) -> Exception | None:
    """Return what to raise for an error of the client; None where it is a defect of ours."""
    code, names = code_of(error), _names(error)
    bucket = url.removeprefix("s3://").partition("/")[0]
    if code in _MISSING:
        return FileNotFoundError(2, "no such object", url)
    if code in _CHANGED:
        return Changed(url)
    if why := _explained(code, names, bucket, endpoint):
        return StoreError(f"{url}: {why}")
    if code:
        message = first_line(error)
        return StoreError(f"{url}: the store refuses ({message}); {_KEPT}")
    if names & {"BotoCoreError", "ValueError"}:
        return StoreError(f"{url}: {first_line(error)}: correct the AWS configuration or --data")
    if isinstance(error, OSError):
        return StoreError(f"{url}: {error.strerror or first_line(error)}; {_KEPT}")
    return None


def _explained(code: str, names: set[str], bucket: str, endpoint: str | None) -> str:
    if names & _NO_CREDENTIALS:
        return f"there are no credentials: {_CREDENTIALS}"
    if names & _OLD_CREDENTIALS:
        return "the session has expired: run aws sso login, or set other credentials"
    if "ProfileNotFound" in names:
        return "there is no AWS profile of the name that AWS_PROFILE says: correct it, or run aws configure"
    if code in _REFUSED:
        return f"the store refuses the credentials ({code}): {_CREDENTIALS}"
    if code == "NoSuchBucket":
        return f"there is no bucket {bucket!r} at {endpoint}: make it, or correct --data"
    if code in _DENIED:
        return (
            "access is denied: the credentials need s3:ListBucket, s3:GetObject, s3:PutObject, s3:DeleteObject and "
            "s3:AbortMultipartUpload there"
        )
    if code in _ELSEWHERE:
        return "the bucket is of another region: set AWS_DEFAULT_REGION to it"
    if code in _BUSY:
        return f"the store keeps answering {code}: run the command again later; {_KEPT}"
    if names & _UNREACHABLE:
        return (
            f"{endpoint} cannot be reached, does not answer or drops the connection: check the network and "
            f"AWS_ENDPOINT_URL, and run the command again; {_KEPT}"
        )
    return ""
