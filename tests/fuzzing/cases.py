"""What a fuzzed parser is: valid inputs, files by their path in a folder, and a call on a folder with a mutant."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ASSETS = ROOT / "scene_assets"
Case = dict[str, bytes]


@dataclass(frozen=True)
class Target:
    """A parser."""

    cases: Callable[[], list[Case]]  # Makes its valid inputs
    run: Callable[[Path], None]  # Parses the folder and uses what it got as the program would
    mutable: str = ""  # Suffix of the path of files that are mutated; empty for all
    names_the_file: bool = True  # Whether an error's message must name the folder or a file of it
    share: float = 1.0  # Share of a campaign's number that is run: less for those that take long


def case_of(folder: Path) -> Case:
    """Take up a folder's files."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def made(make: Callable[[Path], object]) -> Case:
    """Take up what a call writes into an empty folder."""
    with tempfile.TemporaryDirectory() as name:
        make(Path(name))
        return case_of(Path(name))


def laid_out(case: Case, folder: Path) -> None:
    """Write an input's files into an emptied folder."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, raw in case.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(raw)


def utterable(lines: Iterable[str]) -> None:
    """Raise UnicodeEncodeError unless all lines can be printed."""
    for line in lines:
        line.encode()
