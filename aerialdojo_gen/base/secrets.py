"""Keys stay out of what is written: options, answers and messages are cleaned by name and by value."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

REDACTED = "[redacted]"

_SECRET_WORDS = frozenset((
    "apikey", "auth", "authorization", "bearer", "cookie", "credential", "credentials", "key", "passphrase", "passwd",
    "password", "pwd", "secret", "secrets", "sig", "signature", "token",
))  # fmt: skip
# Shells keep the working directory in these, in spite of their names.
_FOLDERS = ("PWD", "OLDPWD")
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
# Shorter values of environment variables are words like "true", which stand anywhere.
_MIN_CHARACTERS = 8
_PATTERNS = (
    (re.compile(r"(?i)\b(bearer|basic)\s+[\w.~+/=-]{8,}"), rf"\1 {REDACTED}"),
    (re.compile(r"\b(?:(?:sk|pk|xai|gsk|hf|gh[pousr])[-_]|AIza)(?=[\w-]*\d)[\w-]{16,}"), REDACTED),
    # A name and a password in a URL, and a key in its query.
    (re.compile(r"(\b[a-zA-Z][\w+.-]*://)[^/\s@\"']+@"), rf"\1{REDACTED}@"),
    (re.compile(r"(?i)([?&][\w.-]*(?:key|token|secret|password|sig|signature)=)[^&\s\"']+"), rf"\1{REDACTED}"),
)


def is_secret_name(name: str) -> bool:
    """Whether what has this name (``X-Auth-Token``) holds a secret; ``key_env`` and the like name a variable."""
    return not name.endswith("_env") and any(word.lower() in _SECRET_WORDS for word in _WORD.findall(name))


class Secrets:
    """The secrets that a run knows of, to be kept out of what it writes."""

    def __init__(self, options: Mapping[str, Any] | None = None, values: Iterable[str] = ()) -> None:
        found = {value for name, value in os.environ.items() if is_secret_name(name) and name not in _FOLDERS}
        found |= set(values)
        _map_texts(options or {}, lambda text, hidden: found.add(text) if hidden else None)
        # The longest first: one may be the beginning of another.
        self._known = sorted({v for v in found if len(v.strip()) >= _MIN_CHARACTERS}, key=len, reverse=True)

    def text(self, text: str) -> str:
        """Return a text without secrets."""
        for value in self._known:
            text = text.replace(value, REDACTED)
        for pattern, instead in _PATTERNS:
            text = pattern.sub(instead, text)
        return text

    def options(self, value: Any) -> Any:
        """Return options, or a part of them, without secrets: by their names, and by what they look like."""
        return _map_texts(value, lambda text, hidden: REDACTED if hidden and text else self.text(text))


def _map_texts(value: Any, change: Callable[[str, bool], Any], hidden: bool = False) -> Any:
    """Change all texts in options, keys too; what changes them hears whether they are under a secret's name."""
    if isinstance(value, Mapping):
        names = {str(key): inner for key, inner in value.items()}
        return {change(k, False): _map_texts(v, change, hidden or is_secret_name(k)) for k, v in names.items()}
    if isinstance(value, (list, tuple)):
        return [_map_texts(item, change, hidden) for item in value]
    return change(value, hidden) if isinstance(value, str) else value
