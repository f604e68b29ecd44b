"""Which of an object's descriptions are for training, and which for test tasks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

WRITTEN = "written"  # the level of a text by a person


def of_side(paraphrases: Sequence[Mapping[str, Any]], *, held_out: bool) -> list[Mapping[str, Any]]:
    """Texts for tasks of a side: what a person wrote alone, else the made ones of the side, else all."""
    written = [text for text in paraphrases if text["level"] == WRITTEN]
    return written or [text for text in paraphrases if text["held_out"] == held_out] or list(paraphrases)
