"""The Hugging Face Hub, or a server that answers as it does: who may write, and what goes wrong in one line each."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, UsageError, brief, first_line, no_package
from aerialdojo_gen.base.secrets import Secrets

TOKEN, ENDPOINT, USUAL = "HF_TOKEN", "HF_ENDPOINT", "https://huggingface.co"
_REPO = re.compile(r"[A-Za-z0-9][\w.-]{0,95}/[A-Za-z0-9][\w.-]{0,95}")
_REVISION = re.compile(r"[\w.][\w./-]{0,199}")


class Hub:
    """A data set on the Hub."""

    def __init__(self, repo: str, verb: str, *, writes: bool = False) -> None:
        if not _REPO.fullmatch(repo) or ".." in repo or repo.endswith(".git"):
            raise UsageError(f"{brief(repo, 100)!r} is no data set's name: write USER/NAME")
        self.repo = repo
        self.endpoint = os.environ.get(ENDPOINT, "").strip().rstrip("/") or USUAL
        # As messages say it: an address may have a password in it.
        self.address = Secrets().text(self.endpoint)
        if not re.match(r"https?://[^\s/]", self.endpoint):
            raise UsageError(f"{ENDPOINT}={brief(self.address, 100)!r} is no address: write https://…")
        self.token: str | bool = os.environ.get(TOKEN, "").strip() or False
        if self.token and _is_open(self.endpoint):
            raise UsageError(
                f"{TOKEN} would go to {self.address} unencrypted: write {ENDPOINT}=https://…, or unset {TOKEN} "
                "to read what is public"
            )
        if writes and not self.token:
            raise AerialDojoError(
                f"{verb} needs a token that may write: export {TOKEN}=hf_…, made at {self.address}/settings/tokens"
            )
        try:
            import huggingface_hub
            from huggingface_hub.utils import disable_progress_bars  # type: ignore[attr-defined]
        except ImportError:
            raise MissingPackage(no_package(verb, "huggingface_hub", "hub")) from None
        disable_progress_bars()
        self.api: Any = huggingface_hub.HfApi(endpoint=self.endpoint, token=self.token, library_name="aerialdojo-gen")

    @contextmanager
    def explain_errors(self, doing: str) -> Iterator[None]:
        """Turn what the server or the network answers into a line."""
        from huggingface_hub import errors

        # The library's own client: its name is another one in other versions.
        known = (errors.HfHubHTTPError.__bases__[0], ConnectionError, TimeoutError)
        try:
            yield
        except Exception as error:
            # What goes wrong in one of its threads comes as a RuntimeError that was caused by it.
            cause: BaseException | None = error
            while cause is not None and not isinstance(cause, known):
                cause = cause.__cause__
            if cause is None or isinstance(error, AerialDojoError):
                raise
            raise self._explain(cause, doing) from None

    def _explain(self, error: BaseException, doing: str) -> AerialDojoError:
        from huggingface_hub import errors

        who = f"{TOKEN} may not see it" if self.token else f"it is private, and {TOKEN} is not set"
        if isinstance(error, errors.RevisionNotFoundError):
            return UsageError(f"{self.repo} at {self.address} has no such revision")
        if not isinstance(error, errors.HfHubHTTPError):
            return AerialDojoError(
                f"cannot reach {self.address} ({self._line(error)}): the same command goes on when there is a way"
            )
        status = error.response.status_code if error.response is not None else 0
        # Without an account the server says of what is private, and of what is not there, 401.
        if status == 404 or (status == 401 and isinstance(error, errors.RepositoryNotFoundError)):
            return UsageError(f"there is no data set {self.repo} at {self.address}, or {who}")
        if status == 401:
            return AerialDojoError(f"{self.address} does not know the token in {TOKEN}: make another")
        if status == 403:
            return AerialDojoError(
                f"{self.address} refuses to {doing} {self.repo} ({self._line(error)}): {TOKEN} needs that right"
            )
        return AerialDojoError(f"{self.address} answers {status}: {self._line(error)}; try again later")

    def _line(self, error: BaseException) -> str:
        said = getattr(error, "server_message", None)
        return Secrets().text(brief(str(said), 160) if said else first_line(error))


def _is_open(address: str) -> bool:
    """Whether what is sent there can be read on the way: not by HTTPS, and to another machine."""
    parts = urlsplit(address)
    return parts.scheme != "https" and parts.hostname not in ("127.0.0.1", "::1", "localhost")


def check_revision(revision: str | None) -> str | None:
    """Return a branch, a tag or a commit as it is; UsageError for what can be none."""
    if revision is not None and (not _REVISION.fullmatch(revision) or ".." in revision):
        raise UsageError(f"{brief(revision, 100)!r} is no branch, tag or commit")
    return revision
