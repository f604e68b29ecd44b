"""The blocks of code in README and docs: fenced ones by their language, indented ones by what stands in them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# A line that begins so is a command; a block with one is a shell block.
PROGRAMS = (
    "aerialdojo-gen", "cp", "curl", "docker", "export", "git", "helm", "kubectl", "make", "pip", "pre-commit",
    "pytest", "python", "python3", "python3.11", "ray", "rm", "sudo", "uv", "vllm",
)  # fmt: skip
_FENCE = re.compile(r"^(`{3,})(\w*)[^\n]*\n(.*?)^\1 *$", re.DOTALL | re.MULTILINE)
_INDENTED = re.compile(r"(?<=\n\n)(?:(?:    .*)?\n)+")


@dataclass(frozen=True)
class Block:
    """A block: its page, the line of its first line, its language (``"indented"`` where none is said), its text."""

    page: Path
    line: int
    language: str
    text: str

    @property
    def place(self) -> str:
        return f"{self.page.name}:{self.line}"


def blocks(page: Path) -> list[Block]:
    """All blocks of a Markdown page, in their order."""
    text = page.read_text(encoding="utf-8")
    found = [
        Block(page, text.count("\n", 0, at.start(3)) + 1, at[2] or "none", at[3]) for at in _FENCE.finditer(text)
    ]
    # Fences are blanked out line by line: what stands indented in them is no block of its own.
    rest = _FENCE.sub(lambda at: re.sub(r"[^\n]+", "", at[0]), text)
    for at in _INDENTED.finditer(rest):
        if at[0].strip():
            begin = at.start() + len(at[0]) - len(at[0].lstrip("\n"))
            lines = [line[4:] for line in at[0].strip("\n").splitlines()]
            if lines[0].startswith("    "):  # a block of a list's item, and what the item goes on with
                lines = [line[4:] for line in lines if line.startswith("    ")]
            found.append(
                Block(page, rest.count("\n", 0, begin) + 1, "indented", "".join(f"{line}\n" for line in lines))
            )
    return sorted(found, key=lambda block: block.line)


def is_shell(block: Block) -> bool:
    """Whether a block is of commands: fenced as such, or indented with a line that begins with a program's name."""
    if block.language in ("sh", "bash", "shell", "console"):
        return True
    words = (_bare(line).partition(" ")[0] for line in block.text.splitlines())
    return block.language == "indented" and any(word in PROGRAMS for word in words)


def commands(block: Block) -> Iterator[str]:
    """The commands of a shell block, one by one: continued lines joined, comments and ``.venv/bin/`` left out."""
    for line in block.text.replace("\\\n", " ").splitlines():
        words = shlex.split(re.sub(r"(^|\s)#\s.*$", "", line))
        for part in shlex.join(words).split(" '&&' ") if words else ():
            yield _bare(part)


def _bare(line: str) -> str:
    return line.removeprefix(".venv/bin/").removeprefix("/opt/ad/bin/")
