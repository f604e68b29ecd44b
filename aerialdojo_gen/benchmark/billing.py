"""What episodes used of an outside service: sums over attempts, and columns of the log."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aerialdojo_gen.benchmark.agents import Usage


def sum_of(a: Usage | None, b: Usage | None) -> Usage | None:
    """Add what two attempts used; what neither knows stays unknown."""
    if a is None or b is None:
        return a or b
    both = {}
    for name in ("input_tokens", "output_tokens", "cost_usd", "request_s"):
        known = [v for v in (getattr(a, name), getattr(b, name)) if v is not None]
        both[name] = sum(known) if known else None
    longest = [v for v in (a.longest_request_s, b.longest_request_s) if v is not None]
    return replace(a, requests=a.requests + b.requests, longest_request_s=max(longest, default=None), **both)


def columns(used: Usage | None) -> dict[str, Any]:
    """Return the columns of `episodes` and `failures` that tell what was used."""
    if used is None:
        return dict.fromkeys(("n_requests", "input_tokens", "output_tokens", "cost_usd"))
    return {
        "n_requests": used.requests,
        "input_tokens": used.input_tokens,
        "output_tokens": used.output_tokens,
        "cost_usd": used.cost_usd,
    }


def times(used: Usage | None) -> dict[str, Any]:
    """Return the columns of `timings` that tell how long requests took."""
    if used is None:
        return {"request_s": None, "longest_request_s": None}
    return {"request_s": used.request_s, "longest_request_s": used.longest_request_s}


def cost(used: Usage | None) -> float:
    """Return the cost, US dollars; 0 where it is not known."""
    return (used.cost_usd or 0.0) if used is not None else 0.0


def tokens(used: Usage | None) -> int:
    """Return the tokens, both ways; 0 where they are not known."""
    return (used.input_tokens or 0) + (used.output_tokens or 0) if used is not None else 0
