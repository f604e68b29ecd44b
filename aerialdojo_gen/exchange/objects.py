"""The targets of imported tasks: numbered where the file does not, each with its picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerialdojo_gen.exchange.tables import IMPORTED_OBJECTS, Tables
from aerialdojo_gen.exchange.task import Task, digest

# Numbers of ours, where other objects of the scene have the file's: out of their way.
_OURS_FROM = 1_000_000


class Objects:
    """Collects what tasks say about their targets; pictures are read at the end, so memory holds none."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[str, object], int] = {}
        self._counts: dict[str, int] = {}
        self._rows: dict[tuple[str, int], dict[str, Any]] = {}
        self._pictures: dict[tuple[str, int], dict[str, Path]] = {}
        self._owners: dict[str, tuple[str, int]] = {}

    def number(self, task: Task) -> int | None:
        """Number the task's target: the file's own number, else one by order of appearance; None for no object."""
        if "target_object_id" in task.known:
            return int(task.known["target_object_id"])
        if task.object_key is None:
            return None
        key = (task.scene, task.object_key)
        if key not in self._numbers:
            self._counts[task.scene] = count = self._counts.get(task.scene, 0) + 1
            self._numbers[key] = _OURS_FROM + count - 1
        return self._numbers[key]

    def add(self, task: Task, number: int) -> list[str | None]:
        """Take in what the task says about its target and its start."""
        known = task.known
        texts = [i.description for i in task.instances if i.description]
        row = {
            "name": known.get("target_name"),
            "mesh_node": known.get("mesh_node"),
            "category": known.get("category"),
            "description": texts[0] if texts else known.get("description"),
            "direction": known.get("direction"),
            "landmark": known.get("landmark"),
        }
        if task.object_m is not None:
            row |= dict(zip(("x_m", "y_m", "z_m"), task.object_m.tolist(), strict=True))
        self._merge(task.scene, number, row)
        if "start_object_id" in known:
            start = {"name": known.get("start_object_name"), "mesh_node": known.get("start_mesh_node")}
            self._merge(task.scene, known["start_object_id"], start)
        return [self._picture((task.scene, number), i.picture) if i.picture else None for i in task.instances]

    def _merge(self, scene: str, number: int, row: dict[str, Any]) -> None:
        kept = self._rows.setdefault((scene, number), {})
        for name, value in row.items():
            if value is not None:
                kept.setdefault(name, value)

    def _picture(self, owner: tuple[str, int], path: Path) -> str:
        name = path.stem
        if self._owners.setdefault(name, owner) != owner:
            name = f"{name}-{digest(*map(str, owner))}"
        self._pictures.setdefault(owner, {}).setdefault(name, path)
        return name

    def write(self, tables: Tables) -> None:
        """Write the rows, one an object and picture, by scene and number."""
        for scene, number in sorted(self._rows):
            empty = dict.fromkeys(IMPORTED_OBJECTS.schema.names)
            row = empty | self._rows[scene, number] | {"scene": scene, "object_id": number}
            pictures = self._pictures.get((scene, number))
            if not pictures:
                tables.object({**row, "reference_image_id": ""})
            for name in sorted(pictures or ()):
                picture = (pictures or {})[name]
                tables.object({**row, "reference_image_id": name, "reference_image": picture.read_bytes()})
