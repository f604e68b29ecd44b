"""What a model may choose from: the sixteen actions by name, or the paper's eight types with common magnitudes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH

_EFFECTS = {
    "Stop": "end the episode",
    "MoveForward": "fly {} m forward, the way the front camera looks",
    "MoveLeft": "fly {} m to the left without turning",
    "MoveRight": "fly {} m to the right without turning",
    "MoveUp": "climb {} m",
    "MoveDown": "sink {} m",
    "TurnLeft": "turn {}° to the left on the spot",
    "TurnRight": "turn {}° to the right on the spot",
}


@dataclass(frozen=True)
class ActionSet:
    """Names that a model answers with, and the actions that they mean."""

    ids: Mapping[str, int]  # The action's id, 0 to 15, by the name that the model is told

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in their order."""
        return tuple(self.ids)

    def described(self) -> str:
        """Return one line an action, with its magnitude."""
        lines = []
        for name, action in self.ids.items():
            full = ACTION_NAMES[action]
            kind = full.rstrip("0123456789")
            lines.append(f"- {name}: {_EFFECTS[kind].format(full.removeprefix(kind))}")
        return "\n".join(lines)

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of an answer."""
        return {
            "type": "object",
            "properties": {
                "thought": {
                    "type": "string",
                    "description": "one or two sentences: what you see, where you go",
                },
                "action": {"type": "string", "enum": list(self.ids)},
            },
            "required": ["thought", "action"],
            "additionalProperties": False,
        }


SIXTEEN = ActionSet({name: k for k, name in enumerate(ACTION_NAMES[:APPROACH])})


def eight(move_m: int, climb_m: int) -> ActionSet:
    """The paper's eight action types (Appendix A), moves of `move_m` and climbs of `climb_m` metres, turns of 15°."""
    magnitudes = {"Stop": "", "Turn": "15", "MoveUp": str(climb_m), "MoveDown": str(climb_m), "Move": str(move_m)}
    ids = {}
    for kind in _EFFECTS:
        size = next(m for start, m in magnitudes.items() if kind.startswith(start))
        ids[kind] = ACTION_NAMES.index(kind + size)
    return ActionSet(ids)
