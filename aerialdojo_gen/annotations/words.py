"""Words of English, read from ``words.toml``."""

from __future__ import annotations

from pathlib import Path

from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.safe_parse import read_toml

TABLES = read_toml(Path(__file__).with_name("words.toml"), AnnotationError)
LISTS = {name: frozenset(words.split()) for name, words in TABLES["lists"].items()}
