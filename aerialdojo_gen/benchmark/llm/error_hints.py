"""What to do about a service that does not work, in half a line: the end of the message that ends a run."""

from __future__ import annotations

import re

from aerialdojo_gen.base.errors import AerialDojoError, AgentUnavailable, ServiceDown, UsageError

# By the kind of a failure that is met in the check before a run.
_BY_KIND = {
    "time-out": "is it busy, or loading its model? Try again, or with a longer --option timeout_s=…",
    "rate limit": "wait, or use another account",
    "bad request": "does it take pictures, and the options model, answer, max_tokens, extra_body?",
    "malformed answer": "is base_url right?",
}
_STATUS = re.compile(r": HTTP (\d{3}): ")


def refused(error: UsageError, model: str, key_variable: str) -> ServiceDown:
    """Make the error that ends a run from a service's refusal of all requests.

    Not what was asked for is wrong, as a `UsageError` says, but what stands behind it: the exit code is 1.
    """
    status = _STATUS.search(str(error))
    code = status[1] if status else ""
    if code == "404":
        mend = f"is --option model={model} served there, and is base_url right?"
    elif code.startswith("3"):
        mend = "it sends requests elsewhere: is base_url right?"
    elif code in ("402", "429"):
        mend = "has the account anything left to spend?"
    else:
        mend = f"is the key in {key_variable} right, and may it use model={model}?"
    return ServiceDown(f"{error}: {mend}")


def unanswered(error: AgentUnavailable) -> AerialDojoError:
    """Make the error that ends the check before a run from a failure of its one request."""
    mend = "" if str(error).endswith("?") else f": {_BY_KIND.get(error.kind, 'try again later')}"
    return AerialDojoError(f"{error}{mend}")
