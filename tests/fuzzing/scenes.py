"""What describes a scene: annotations, pipelines, recipes, props, materials."""

from __future__ import annotations

import contextlib
import json
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
from fuzzing.cases import ASSETS, ROOT, Case, Target, utterable
from fuzzing.meshes import court_glb
from fuzzing.mutate import toml_dumped
from fuzzing.plans import PLANS
from support import annotation_scenes

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.format import format_annotations, parse_annotations
from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.pipeline.stages.work.annotate_import import annotation_tables
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.catalogue_files import FOLDERS, catalogue_files
from aerialdojo_gen.scenes.glb import write_glb
from aerialdojo_gen.studio.annotate.storage import parse_whole


def _annotations() -> list[Case]:
    plain = format_annotations(annotation_scenes.street_annotations())
    anchored = json.loads(plain)
    anchored["objects"][0]["anchor"] = {"position_m": [18.0, 16.0, 2.0], "yaw_deg": 45.0}
    return [{"U_Street_0.json": plain.encode()}, {"U_Street_0.json": json.dumps(anchored).encode()}]


_street = cache(annotation_scenes.street_vocabulary)


def _read_annotations(folder: Path) -> None:
    path = folder / "U_Street_0.json"
    raw = path.read_bytes()
    vocabulary = _street()
    try:
        annotations = parse_whole(raw, "U_Street_0", str(path))
    except AerialDojoError:
        with contextlib.suppress(UnicodeDecodeError):
            source = parse_annotations(raw.decode())
            assert source.faults or source.scene != "U_Street_0" or _twice(source)
            utterable(map(str, source.faults))
        raise
    source = parse_annotations(format_annotations(annotations).encode().decode())
    assert source.annotations == annotations
    checked = SourceCheck(source, vocabulary)
    utterable(map(str, checked.faults))
    if not checked.faults:
        annotation_tables(annotations, checked.claims)


def _twice(source) -> bool:
    entries = (source.landmarks, source.objects)
    return any(len({e.id for e in some.values()}) < len(some) for some in entries)


def _pipelines() -> list[Case]:
    whole = {
        "name": "all", "seed": 3, "scenes": ["U_*"], "stages": ["plan", "filter"], "scene_assets": "a",
        "recipes": "b",
        "annotations": "c", "embodiment": {"radius_m": 0.3},
        "anchor-sample": {"azimuths": 8, "elevations_deg": [0.0, 10.0], "weights": {"clip": 1.0},
                          "clip": {"vision": "v.onnx", "text": "t.onnx", "tokenizer": "t.json"},
                          "vlm": {"model": "m"}},
        "reference-images": {"width": 64}, "pair-objects": {"start_variants": 2},
        "plan": {"cell_m": 0.5, "ladder": [{"weight": 1.1, "budget": 1000, "heading_sectors": 4}]},
        "task": {"base": {"min_length_m": 5, "max_length_m": 30, "action_budget": 90}},
        "split": {"id_train_fraction": 0.5}, "render": {"views": ["front"], "offsets_m": {"front": [0.1, 0, 0]}},
    }  # fmt: skip
    paths = [ROOT / "pipelines" / "smoke.toml", ROOT / "pipelines" / "aerialdojo-200k.toml"]
    return [{"p.toml": toml_dumped(whole).encode()}, *({"p.toml": p.read_bytes()} for p in paths)]


_COURT = {
    "plan": 1, "seed": 5, "size_m": [36.0, 36.0], "ceiling_m": 15.0, "sky": "#96bee6", "sun": [0.4, -0.3, 0.8],
    "palette": {"wall": "brick", "path": "paving"}, "inventory": {"bench": 1}, "floor_m": {"eaves": 4.0},
    "site": [
        {"paint": [[-2, -9, 2, 9]], "material": "path"},
        {"make": "walls", "lines": [[[-16, -16], [16, -16]]], "height_m": 3.0, "material": "wall"},
        {"category": "roof", "parts": [
            {"shape": "block", "role": "wood", "corners": [-6, -6, 0, 0], "z": ["eaves", "eaves + 0.2"]}]},
        {"place": [["bench", 3.0, 4.0, 30.0], ["mailbox", 5, 5, 0, 1.0]]},
    ],
}  # fmt: skip


def _plans() -> list[Case]:
    return [{f"scenes/{name}.toml": toml_dumped(plan).encode()} for name, plan in PLANS.items()]


def _build(folder: Path) -> None:
    (path,) = folder.rglob("*.toml")
    write_glb(build_scene(path, load_catalogue(ASSETS)), path.with_suffix(".glb"))


def _imported_recipes() -> list[Case]:
    recipe = {"imported": {
        "source": "x.glb", "source_sha256": "0" * 64, "up": "z", "scale": 1.0, "ceiling_m": 12.0, "sky": "#96bee6",
        "sun": [0.45, -0.35, 0.82], "crop_m": [0.0, 0.0, 50.0],
        "cuts": [{"node": "box_000", "category": "box", "low_m": [4.5, 0.5, 0.5], "high_m": [6.5, 2.5, 2.5]}],
    }}  # fmt: skip
    return [{"U_Court_0.toml": toml_dumped(recipe).encode(), "U_Court_0.glb": court_glb()}]


def _props() -> list[Case]:
    """One category a file: every eighth, so that each shape, builder and file is there."""
    materials = tomllib.loads((ASSETS / "materials.toml").read_text())
    tables = [(p, name, body) for p in catalogue_files(ASSETS) for name, body in tomllib.loads(p.read_text()).items()]
    built = {body["builder"]: (p, name, body) for p, name, body in tables if "builder" in body}
    shapes = {part["shape"]: (p, name, body) for p, name, body in tables for part in body.get("parts", ())}
    chosen = [*tables[::8], *built.values(), *shapes.values()]
    cases = []
    for _, name, body in chosen:
        text = toml_dumped({name: body})
        named = {key: entry for key, entry in materials.items() if key in text}  # all of them take long to read
        cases.append({"materials.toml": toml_dumped(named).encode(), f"{FOLDERS[1]}/x.toml": text.encode()})
    return cases


def _instantiate(folder: Path) -> None:
    catalogue = load_catalogue(folder)
    for category in catalogue:
        for look in catalogue[category].variants[:4]:
            rng = np.random.Generator(np.random.PCG64(1))
            instance = catalogue.instantiate(category, "x_000", rng, (1.0, 2.0, 0.0), 30.0, look.name)
            assert all(np.isfinite(part.vertices).all() for part in instance.parts)


def _materials() -> list[Case]:
    own = {"brick": {"texture": "brick", "colour": "#9a4a3c", "tile_m": 0.75}, "paint": {"colour": "#808080"}}
    box = {"shape": "box", "role": "body", "size": [1, 1, 2]}
    prop = {"post": {"name": "post", "roles": {"body": "brick"}, "parts": [box]}}
    return [{"materials.toml": toml_dumped(own).encode(), f"{FOLDERS[1]}/x.toml": toml_dumped(prop).encode()}]


TARGETS = {
    "annotations": Target(_annotations, _read_annotations),
    "pipeline": Target(_pipelines, lambda folder: load_pipeline(folder / "p.toml").model_dump_json()),
    "recipe": Target(lambda: [{"scenes/U_Court_0.toml": toml_dumped(_COURT).encode()}], _build),
    "plan": Target(_plans, _build, share=0.05),
    "recipe-imported": Target(_imported_recipes, _build, ".toml", names_the_file=False),
    "prop": Target(_props, _instantiate, "x.toml"),
    "materials": Target(_materials, _instantiate),
}
