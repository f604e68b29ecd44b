"""What the page says of annotations: where each entry is, what it lacks, what the checks of the import find."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from aerialdojo_gen.annotations.bearings import nearest_landmark
from aerialdojo_gen.annotations.check import check_source
from aerialdojo_gen.annotations.format import Annotations, Object, format_annotations, parse_annotations
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.imports.forms import is_unnamed
from aerialdojo_gen.studio.annotate.document import describe_entry

_PATH = re.compile(r"^(landmarks|objects)\[(\d+)\](?:\.(\w+))?")
_MENTION = re.compile(r"\b(landmarks|objects)\[(\d+)\]")


class Describer:
    """Describes annotations of one scene as JSON; not thread-safe."""

    def __init__(self, vocabulary: Vocabulary, counts: tuple[int, int] | None) -> None:
        self._scene, self._vocabulary, self._counts = vocabulary.scene, vocabulary, counts
        self._geometry = SceneGeometry(vocabulary.scene)  # caches results

    def describe(self, annotations: Annotations) -> dict[str, Any]:
        """Describe all entries: ``landmarks``, ``objects`` (each with its ``faults``) and ``faults`` of the file."""
        source = parse_annotations(format_annotations(annotations))
        faults: dict[tuple[str, int], list[dict[str, str]]] = {}
        general = []
        faulty = check_source(source, self._vocabulary, self._counts, self._geometry).faults
        for fault in faulty:
            message = _MENTION.sub(
                lambda m: describe_entry(m[1], getattr(annotations, m[1])[int(m[2])]), fault.message
            )
            at = _PATH.match(fault.path)
            if at is None:
                general.append(message)
            else:
                faults.setdefault((at[1], int(at[2])), []).append({"field": at[3] or "", "message": message})
        landmarks = [
            {**entry.model_dump(), **self.place(entry.node), "faults": faults.get(("landmarks", k), [])}
            for k, entry in enumerate(annotations.landmarks)
        ]
        objects = [
            self._object(annotations, entry, faults.get(("objects", k), []))
            for k, entry in enumerate(annotations.objects)
        ]
        return {"landmarks": landmarks, "objects": objects, "faults": general}

    def _object(self, annotations: Annotations, entry: Object, faults: list[dict[str, str]]) -> dict[str, Any]:
        lacks = [key for key in ("name", "category") if not getattr(entry, key).strip()]
        lacks += ["person"] if is_unnamed(entry.node, entry.category) else []
        lacks += ["check"] if any(fault["field"] not in lacks for fault in faults) else []
        return {
            **entry.model_dump(),
            "description": entry.description or "",
            **self.place(entry.node),
            **self.bearing(annotations, entry.node),
            "faults": faults,
            "lacks": lacks,
        }

    def place(self, node: str) -> dict[str, Any]:
        """Middle of a node's box, ``position_m``; None where the scene has no such node."""
        position_m = self._scene[node].centroid.round(3).tolist() if node in self._scene else None
        return {"position_m": position_m}

    def bearing(self, annotations: Annotations, node: str) -> dict[str, Any]:
        """Nearest ``landmark`` and ``direction`` of a node, as the task will state them; None where there is none."""
        marks = [m for m in sorted(annotations.landmarks, key=lambda m: m.id) if m.node in self._scene]
        places = np.array([self._scene[m.node].centroid for m in marks]).reshape(-1, 3)
        nearest = nearest_landmark(self._scene[node].centroid, places) if node in self._scene else None
        if nearest is None:
            return {"landmark": None, "direction": None}
        return {"landmark": marks[nearest.landmark].name, "direction": nearest.direction}
