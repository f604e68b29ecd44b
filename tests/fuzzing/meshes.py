"""Meshes: scene files of our own, and those that `add-scene` reads."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from fuzzing.cases import Case, Target, made, utterable
from support import foreign, rendered

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.imports.files import read_into, unpack_nodes
from aerialdojo_gen.imports.import_mesh import import_mesh
from aerialdojo_gen.scenes.glb import read_glb, write_glb


@cache
def court_glb() -> bytes:
    return made(lambda folder: write_glb(rendered.courtyard(), folder / "x.glb"))["x.glb"]


def _read_own(folder: Path) -> None:
    scene = read_glb(folder / "U_Court_0.glb")
    for instance in scene.instances:
        assert np.isfinite(instance.bounds).all()
        assert instance.faces.size
    assert len({tuple(i.centroid) for i in scene.instances})
    write_glb(scene, folder / "again.glb")


def _village(suffix: str) -> Callable[[], list[Case]]:
    def cases() -> list[Case]:
        scene = foreign.village()
        if suffix == "3ds":
            meshes = [(f"house{k}", body) for k, body in enumerate(foreign.bodies(scene))]
            return [{"m.3ds": foreign.three_ds(meshes, (200, 40, 40))}]
        thing = scene if suffix in ("glb", "obj") else scene.to_mesh()
        if suffix == "obj":
            return [made(lambda folder: thing.export(folder / "m.obj"))]
        kinds = {
            "ply": ({"encoding": "ascii"}, {"encoding": "binary"}),
            "stl": ({"file_type": "stl"}, {"file_type": "stl_ascii"}),
        }
        out = []
        for options in kinds.get(suffix, ({},)):
            raw = thing.export(file_type=options.pop("file_type", suffix), **options)
            out.append({f"m.{suffix}": raw if isinstance(raw, bytes) else raw.encode()})
        return out

    return cases


def _read_mesh(folder: Path) -> None:
    path = next(p for p in folder.iterdir() if p.stem == "m" and p.suffix != ".mtl")
    out = folder / "nodes.npz"
    try:
        fault = read_into(path, out)
    except MemoryError:
        fault = "needs too much memory"
    if fault:
        raise AerialDojoError(fault)
    scene, repairs = import_mesh("U_Mine_0", unpack_nodes(out))
    utterable(repairs.lines)
    write_glb(scene, folder / "own.glb")
    read_glb(folder / "own.glb")


TARGETS = {
    "glb": Target(lambda: [{"U_Court_0.glb": court_glb()}], _read_own),
    **{
        f"mesh-{suffix}": Target(_village(suffix), _read_mesh, names_the_file=False)
        for suffix in ("glb", "obj", "stl", "ply", "3ds")
    },
}
