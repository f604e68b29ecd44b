"""What people call by name: the nearest known name for one that does not exist, and scenes by name or glob."""

from __future__ import annotations

import difflib
import fnmatch
from collections.abc import Iterable, Sequence

from aerialdojo_gen.base.errors import UsageError, brief

# What a line has room for.
_MAX_LISTED = 20


def closest(name: str, known: Iterable[str], most: int = 1, *, cutoff: float = 0.6) -> list[str]:
    """Return the known names that are most like `name`, the best first, whatever their case."""
    folded: dict[str, str] = {}
    for real in known:
        folded.setdefault(real.casefold(), real)
    return [folded[found] for found in difflib.get_close_matches(name.casefold(), list(folded), most, cutoff)]


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """Say what was probably meant: ``"did you mean 'box'?"``; empty where nothing is like it."""
    near = [repr(found) for found in closest(name, known, most)]
    return f"did you mean {' or '.join([', '.join(near[:-1]), near[-1]] if near[1:] else near)}?" if near else ""


def nearest(name: str, known: Iterable[str], most: int = 1) -> str:
    """Say it as the end of a message: ``": did you mean 'box'?"``, or nothing."""
    meant = did_you_mean(name, known, most)
    return f": {meant}" if meant else ""


def unknown(what: str, name: str, known: Iterable[str], *, besides: Sequence[str] = (), most: int = 1) -> str:
    """Say that there is nothing of a name, with what was probably meant, else with what there is."""
    names = list(known)
    return f"{what} {brief(name, 100)!r}: {did_you_mean(name, names, most) or _listed([*names, *besides])}"


def as_names(given: str | Iterable[str]) -> tuple[str, ...]:
    """Return names, where one may stand alone."""
    return (given,) if isinstance(given, str) else tuple(given)


def check_known(what: str, names: Iterable[str], known: Iterable[str], *, besides: Sequence[str] = ()) -> None:
    """Refuse names that do not exist: `UsageError` for the first."""
    listed = [*known]
    for name in names:
        if name not in (*listed, *besides):
            raise UsageError(unknown(what, name, listed, besides=besides))


def _listed(names: Sequence[str]) -> str:
    if not names:
        return "there is none"
    more = len(names) - _MAX_LISTED
    shown = ", ".join(names[:_MAX_LISTED]) + (f" and {more:,} more" if more > 0 else "")
    return f"there {'is' if len(names) == 1 else 'are'} {shown}"


def choose_scenes(patterns: Sequence[str] | None, known: Sequence[str], what: str = "scene") -> list[str]:
    """Resolve names and globs to scenes, or to what else has names."""
    if not known:
        raise UsageError("there are no scenes: the folder of recipes is empty")
    chosen: set[str] = set()
    for pattern in patterns or ("*",):
        # Not `filter`, which folds case and slashes on some systems.
        matches = [name for name in known if fnmatch.fnmatchcase(name, pattern)]
        if not matches:
            raise UsageError(unknown(f"no {what}", pattern, known, most=3))
        chosen.update(matches)
    return [name for name in known if name in chosen]
