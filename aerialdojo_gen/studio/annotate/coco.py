"""COCO-style export: the annotated objects' boxes in the pictures from their anchors."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerialdojo_gen.annotations.format import Object
from aerialdojo_gen.store.atomic import atomic_write

if TYPE_CHECKING:
    from aerialdojo_gen.studio.annotate.session import AnnotationSession

# Minimum visible pixels of an object.
MIN_PIXELS = 16
_DATE = (1980, 1, 1, 0, 0, 0)  # fixed, so that the same annotations give the same bytes


def coco_zip(session: AnnotationSession) -> bytes:
    """Pack ``instances.json`` and ``images/*.png``."""
    document, pictures = coco(session)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
        archive.writestr(zipfile.ZipInfo("instances.json", _DATE), text, zipfile.ZIP_DEFLATED)
        for name, png in pictures.items():
            archive.writestr(zipfile.ZipInfo(f"images/{name}", _DATE), png)
    return buffer.getvalue()


def write_coco(session: AnnotationSession, path: Path) -> Path:
    """Write `coco_zip` to a file atomically."""
    content = coco_zip(session)
    session.anchors.close()
    atomic_write(path.parent, path.name, content)
    return path


def coco(session: AnnotationSession) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Make the COCO document, boxes as left, top, width and height in pixels, and its pictures by file name."""
    entries = [e for e in session.storage.load().annotations.objects if e.node in session.scene]
    names = sorted({e.category for e in entries})
    number = {name: k for k, name in enumerate(names, start=1)}
    of_node = {e.node: e for e in entries}
    images: list[dict[str, Any]] = []
    boxes: list[dict[str, Any]] = []
    pictures: dict[str, bytes] = {}
    for entry in entries:
        pose = _anchor(session, entry)
        if pose is None:
            continue
        view = session.anchors.view(*pose)
        name = f"{session.scene.name}_{entry.id:04d}.png"
        pictures[name] = view.png
        width, height = session.anchors.size
        images.append({
            "id": entry.id, "file_name": name, "width": width, "height": height,
            "position_m": pose[0].tolist(), "yaw_rad": pose[1],
        })  # fmt: skip
        for node in sorted(view.boxes):
            if node not in of_node or view.pixels[node] < MIN_PIXELS:
                continue
            u0, v0, u1, v1 = view.boxes[node]
            boxes.append({
                "id": len(boxes) + 1, "image_id": entry.id, "category_id": number[of_node[node].category],
                "bbox": [u0, v0, u1 - u0, v1 - v0], "area": view.pixels[node], "iscrowd": 0,
                "object_id": of_node[node].id, "name": of_node[node].name,
            })  # fmt: skip
    document = {
        "info": {"description": f"Annotated objects of {session.scene.name} in the pictures from their anchors"},
        "images": images,
        "annotations": boxes,
        "categories": [{"id": number[name], "name": name} for name in names],
    }
    return document, pictures


def _anchor(session: AnnotationSession, entry: Object) -> tuple[Any, float] | None:
    if entry.anchor is not None:
        return np.array(entry.anchor.position_m), float(np.radians(entry.anchor.yaw_deg))
    rows = session.anchors.candidates(entry)
    return (np.array([rows[0][f"{a}_m"] for a in "xyz"]), rows[0]["yaw_rad"]) if rows else None
