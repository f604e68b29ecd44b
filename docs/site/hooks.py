"""What mkdocs does beside building pages: adds those that lie elsewhere or are written from the program."""

from __future__ import annotations

import posixpath
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).parent))
from reference import pages

ROOT = Path(__file__).resolve().parents[2]
# Pages of the repository, by where the site has them.
BROUGHT = {
    "index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md",
    "reference/scene-assets.md": "scene_assets/README.md", "reference/annotations.md": "annotations/README.md",
}  # fmt: skip
_AT = {source: page for page, source in BROUGHT.items()}
_LINK = re.compile(r"\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\((?!https?:|#|mailto:)([^)\s#]+)(#[^)]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages."""
    for page, source in BROUGHT.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_relinked(text, source, page)))
    for page, text in pages().items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Let links out of docs/ lead to where the site has those pages."""
    if page.file.src_uri in BROUGHT or page.file.generated_by:
        return markdown
    return _relinked(markdown, f"docs/{page.file.src_uri}", page.file.src_uri)


def _relinked(text: str, source: str, page: str) -> str:
    """Turn links of a file of the repository into those of its page; what the site lacks is named, not linked."""

    def link(at: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), at[2]))
        there = _AT.get(target) or (target.removeprefix("docs/") if target.startswith("docs/") else None)
        if there is None:
            return f"{at[1]} (`{target.removeprefix('aerialdojo_gen/')}`)"
        return f"[{at[1]}]({posixpath.relpath(there, posixpath.dirname(page) or '.')}{at[3] or ''})"

    return _LINK.sub(link, text)
