"""Open terrain as surveys deliver it: a heightfield without an underside, with boxes standing on it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from aerialdojo_gen.scenes.terrain import Terrain

CELL_M = 2.0


@dataclass(frozen=True)
class Hills:
    """Heights, in rows that run north from the origin, and which of the cells between them have no surface."""

    heights_m: np.ndarray
    missing: np.ndarray

    @property
    def ground(self) -> Terrain:
        return Terrain(0.0, 0.0, CELL_M, self.heights_m)

    @property
    def size_m(self) -> np.ndarray:
        return (np.array(self.heights_m.shape[::-1]) - 1) * CELL_M

    def z(self, xy: np.ndarray) -> np.ndarray:
        """Height of the surface at points (n, 2) in the field's own frame; NaN where there is none."""
        xy = np.asarray(xy, dtype=np.float64)
        inside = ((xy >= 0) & (xy <= self.size_m)).all(axis=1)
        j, i = np.clip(np.floor(xy / CELL_M).astype(int), 0, np.array(self.missing.shape[::-1]) - 1).T
        return np.where(inside & ~self.missing[i, j], self.ground.z(*xy.T), np.nan)

    def mesh(self, turned: bool = False) -> trimesh.Trimesh:
        """The sheet; `turned` winds it the wrong way round, as imports often are."""
        faces = self.ground.triangles()[np.tile(~self.missing.ravel(), 2)]
        return trimesh.Trimesh(self.ground.corners(), faces[:, ::-1] if turned else faces, process=False)


def hills(seed: int, cells: int = 20, relief_m: float = 12.0, holes: int = 0, ragged: bool = False) -> Hills:
    """Draw a heightfield of a few waves; with holes in its middle, or corners torn off."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1))
    z = np.zeros_like(x)
    for octave in range(1, 4):
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        z += np.sin(2 * np.pi * octave * (x * np.cos(angle) + y * np.sin(angle)) + phase) / octave
    z += rng.normal(0, 0.05, z.shape)
    missing = np.zeros((cells, cells), dtype=bool)
    for _ in range(holes):
        i, j = rng.integers(3, cells - 5, 2)
        missing[i : i + 2, j : j + 2] = True
    if ragged:
        i, j = np.mgrid[0:cells, 0:cells]
        missing |= i + j < rng.integers(cells // 3, cells // 2)
        missing |= (cells - 1 - i) + j < rng.integers(cells // 3, cells // 2)
    return Hills((z - z.min()) / np.ptp(z) * relief_m, missing)


def standing(field: Hills, n: int, seed: int, foot_m: float = 5.0) -> list[trimesh.Trimesh]:
    """Boxes on the surface, their feet `foot_m` deep in it, at places that have one; coloured in turn."""
    rng = np.random.default_rng(seed)
    boxes: list[trimesh.Trimesh] = []
    while len(boxes) < n:
        half = rng.uniform([0.8, 0.8], [1.6, 1.6])
        xy = rng.uniform(4, field.size_m - 4)
        corners = xy + half * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        ground = field.z(corners)
        apart = all(np.abs(xy - b.centroid[:2]).max() > 5.0 for b in boxes)
        if np.isnan(ground).any() or not apart:
            continue
        top = ground.max() + rng.uniform(1.5, 5.0)
        box = trimesh.creation.box(bounds=[[*(xy - half), max(0.0, ground.min() - foot_m)], [*(xy + half), top]])
        paint = [(200, 40, 40), (40, 90, 200), (60, 150, 60), (230, 210, 90)][len(boxes) % 4]
        box.visual.face_colors = np.tile((*paint, 255), (12, 1))
        boxes.append(box)
    return boxes


def write_hills(field: Hills, boxes: list[trimesh.Trimesh], path: Path, turned: bool = False) -> Path:
    """Write the sheet and its boxes as a GLB of named nodes, metres, z up."""
    scene = trimesh.Scene()
    sheet = field.mesh(turned)
    sheet.visual.face_colors = np.tile((110, 120, 90, 255), (len(sheet.faces), 1))
    scene.add_geometry(sheet, node_name="Terrain")
    for k, box in enumerate(boxes):
        scene.add_geometry(box, node_name=f"Hut.{k:03d}")
    scene.export(path)
    return path
