"""Open terrain as surveys deliver it: a heightfield without an underside, with boxes standing on it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

CELL_M = 2.0


@dataclass(frozen=True)
class Hills:
    """Heights at the corners of square cells, in metres; rows run north, the first corner lies at the origin.

    Attributes
    ----------
    heights_m : (rows, columns) float64
    missing : (rows - 1, columns - 1) bool
        Cells without a surface.
    """

    heights_m: np.ndarray
    missing: np.ndarray

    @property
    def size_m(self) -> np.ndarray:
        return (np.array(self.heights_m.shape[::-1]) - 1) * CELL_M

    def z(self, xy: np.ndarray) -> np.ndarray:
        """Height of the surface at points (n, 2) in the field's own frame; NaN where there is none."""
        u, v = (np.asarray(xy, dtype=np.float64) / CELL_M).T
        rows, columns = self.missing.shape
        inside = (u >= 0) & (u <= columns) & (v >= 0) & (v <= rows)
        j = np.clip(np.floor(u).astype(int), 0, columns - 1)
        i = np.clip(np.floor(v).astype(int), 0, rows - 1)
        s, t = u - j, v - i
        h = self.heights_m
        sw, se, nw, ne = h[i, j], h[i, j + 1], h[i + 1, j], h[i + 1, j + 1]
        z = np.where(s >= t, sw + s * (se - sw) + t * (ne - se), sw + t * (nw - sw) + s * (ne - nw))
        return np.where(inside & ~self.missing[i, j], z, np.nan)

    def mesh(self, turned: bool = False) -> trimesh.Trimesh:
        """The sheet; `turned` winds it the wrong way round, as imports often are."""
        rows, columns = self.heights_m.shape
        x, y = np.meshgrid(np.arange(columns) * CELL_M, np.arange(rows) * CELL_M)
        i, j = np.nonzero(~self.missing)
        sw = i * columns + j
        faces = np.concatenate([
            np.column_stack([sw, sw + 1, sw + columns + 1]), np.column_stack([sw, sw + columns + 1, sw + columns]),
        ])  # fmt: skip
        vertices = np.column_stack([x.ravel(), y.ravel(), self.heights_m.ravel()])
        return trimesh.Trimesh(vertices, faces[:, ::-1] if turned else faces, process=False)


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
