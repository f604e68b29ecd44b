"""What is fuzzed: for every parser its valid inputs, and a call that takes a folder with a mutant in it.

A target's call raises what it raises; nothing but an `AerialDojoError` is right.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import annotation_scenes
import court
import foreign
import numpy as np
import rendered
import task_files

from aerialdojo_gen.annotate.storage import parse_whole
from aerialdojo_gen.annotations.check import check_source
from aerialdojo_gen.annotations.format import format_annotations, parse_annotations
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.benchmark import journal
from aerialdojo_gen.config.pipeline import load_pipeline
from aerialdojo_gen.errors import AerialDojoError
from aerialdojo_gen.exchange.importing import Options, import_benchmark
from aerialdojo_gen.imports.adopt import adopt
from aerialdojo_gen.imports.files import read_into, unpacked
from aerialdojo_gen.layouts.build import build_scene
from aerialdojo_gen.llm.answer import parse_answer
from aerialdojo_gen.rendering import finished
from aerialdojo_gen.rendering.codecs import PngWriter, VideoWriter
from aerialdojo_gen.rendering.reader import read_recording
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.catalogue_files import FOLDERS, catalogue_files
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scoring.vlm import read_order
from aerialdojo_gen.stages.work.annotate_import import annotation_tables
from aerialdojo_gen.store import shards as store
from fuzzing.mutate import toml_dumped

ROOT = Path(__file__).resolve().parents[2]
ASSETS = ROOT / "scene_assets"
Case = dict[str, bytes]


@dataclass(frozen=True)
class Target:
    """A parser.

    Attributes
    ----------
    cases : callable
        Makes its valid inputs: files by their path in a folder.
    run : callable
        Parses the folder and uses what it got as the program would.
    mutable : str
        Suffix of the path of files that are mutated; empty for all.
    names_the_file : bool
        Whether an error's message must name the folder or a file of it.
    share : float
        Share of a campaign's number that is run: less for those that take long.
    """

    cases: Callable[[], list[Case]]
    run: Callable[[Path], None]
    mutable: str = ""
    names_the_file: bool = True
    share: float = 1.0


def case_of(folder: Path) -> Case:
    """Take up a folder's files."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def _made(make: Callable[[Path], object]) -> Case:
    with tempfile.TemporaryDirectory() as name:
        make(Path(name))
        return case_of(Path(name))


# Annotations


def _annotations() -> list[Case]:
    plain = format_annotations(annotation_scenes.street_annotations())
    anchored = json.loads(plain)
    anchored["objects"][0]["anchor"] = {"position_m": [18.0, 16.0, 2.0], "yaw_deg": 45.0}
    return [{"U_Street_0.json": plain.encode()}, {"U_Street_0.json": json.dumps(anchored).encode()}]


@cache
def _street() -> tuple[object, SceneGeometry]:
    scene = annotation_scenes.street()
    return scene, SceneGeometry(scene)


def _read_annotations(folder: Path) -> None:
    path = folder / "U_Street_0.json"
    raw = path.read_bytes()
    scene, geometry = _street()
    try:
        annotations = parse_whole(raw, "U_Street_0", str(path))
    except AerialDojoError:
        with contextlib.suppress(UnicodeDecodeError):
            source = parse_annotations(raw.decode())
            assert source.faults or source.scene != "U_Street_0" or _twice(source)
            _utterable(map(str, source.faults))
        raise
    source = parse_annotations(format_annotations(annotations).encode().decode())
    assert source.annotations == annotations
    faults = check_source(source, scene, annotation_scenes.NAMES, None, geometry)
    _utterable(map(str, faults))
    if not faults:
        annotation_tables(annotations, scene)


def _twice(source) -> bool:
    entries = (source.landmarks, source.objects)
    return any(len({e.id for e in some.values()}) < len(some) for some in entries)


def _utterable(lines) -> None:
    for line in lines:
        line.encode()


# Pipelines, recipes, props


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
        "filter": {"base": {"min_length_m": 5, "max_length_m": 30, "action_budget": 90}},
        "split": {"id_train_fraction": 0.5}, "render": {"views": ["front"], "offsets_m": {"front": [0.1, 0, 0]}},
    }  # fmt: skip
    paths = [ROOT / "pipelines" / "smoke.toml", ROOT / "pipelines" / "aerialdojo-200k.toml"]
    return [{"p.toml": toml_dumped(whole).encode()}, *({"p.toml": p.read_bytes()} for p in paths)]


def _read_pipeline(folder: Path) -> None:
    load_pipeline(folder / "p.toml").model_dump_json()


_COURT = {
    "layout": "courtyard", "seed": 5, "size_m": [36.0, 36.0], "ceiling_m": 15.0, "sky": "#96bee6", "sun": [0.4,
    -0.3, 0.8],
    "palette": {"wall": "brick", "path": "paving"}, "inventory": {"bench": 1},
    "parameters": {"walls": [[-16, -16, 16, -16, 3.0]], "roofs": [[-6, -6, 0, 0, 4.0]], "paths": [[-2, -9, 2, 9]],
                   "things": [{"category": "bench", "at": [3.0, 4.0], "yaw": 30.0}, {"category": "mailbox",
                   "at": [5, 5], "z": 1.0}]},
}  # fmt: skip


def _recipes() -> list[Case]:
    return [{"scenes/U_Court_0.toml": toml_dumped(_COURT).encode()}]


def _build(folder: Path) -> None:
    scene = build_scene(folder / "scenes" / "U_Court_0.toml", load_catalogue(ASSETS))
    write_glb(scene, folder / "scenes" / "U_Court_0.glb")


def _imported_recipes() -> list[Case]:
    recipe = {"imported": {
        "source": "x.glb", "source_sha256": "0" * 64, "up": "z", "scale": 1.0, "ceiling_m": 12.0, "sky": "#96bee6",
        "sun": [0.45, -0.35, 0.82], "crop_m": [0.0, 0.0, 50.0],
        "cuts": [{"node": "box_000", "category": "box", "low_m": [4.5, 0.5, 0.5], "high_m": [6.5, 2.5, 2.5]}],
    }}  # fmt: skip
    return [{"U_Court_0.toml": toml_dumped(recipe).encode(), "U_Court_0.glb": _court_glb()}]


def _build_imported(folder: Path) -> None:
    scene = build_scene(folder / "U_Court_0.toml", load_catalogue(ASSETS))
    write_glb(scene, folder / "built.glb")


def _layouts() -> list[Case]:
    return [{f"scenes/{p.name}": p.read_bytes()} for p in sorted((ASSETS / "scenes").glob("*.toml"))]


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
    prop = {
        "post": {
            "name": "post",
            "roles": {"body": "brick"},
            "parts": [{"shape": "box", "role": "body", "size": [1, 1, 2]}],
        }
    }
    return [{"materials.toml": toml_dumped(own).encode(), f"{FOLDERS[1]}/x.toml": toml_dumped(prop).encode()}]


# Meshes


@cache
def _court_glb() -> bytes:
    return _made(lambda folder: write_glb(rendered.courtyard(), folder / "x.glb"))["x.glb"]


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
            return [_made(lambda folder: thing.export(folder / "m.obj"))]
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
    fault = read_into(path, out)
    if fault:
        raise AerialDojoError(fault)
    scene, repairs = adopt("U_Mine_0", unpacked(out))
    _utterable(repairs.lines)
    write_glb(scene, folder / "own.glb")
    read_glb(folder / "own.glb")


# Others' benchmarks


def _aerialdojo() -> list[Case]:
    from test_import_benchmark_layout import document, put

    return [_made(lambda folder, turn=turn: put(folder, *document(turn))) for turn in (15, 60)]


def _written(document: Callable[[Path], object]) -> Callable[[], list[Case]]:
    return lambda: [_made(lambda folder: task_files.write(folder / "tasks.json", document(folder)))]


def _import(format_name: str, file: str = "tasks.json") -> Callable[[Path], None]:
    def run(folder: Path) -> None:
        frame = "ned" if format_name in ("cityavos", "openfly") else None
        for skip_bad in (False, True):
            options = Options(frame=frame, skip_bad=skip_bad)
            try:
                report = import_benchmark(format_name, [folder / file], folder / "data", options, force=True)
            except AerialDojoError:
                if skip_bad:
                    raise
            else:
                json.dumps(report.document()).encode()
                break

    return run


# Answers, shards, recordings, journals


def _answers() -> list[Case]:
    texts = (
        '{"thought": "Nothing here.", "action": "MoveForward3"}',
        '<think>It is there.</think>\n```json\n{"action": "Stop"}\n```',
        '{"order": [3, 1, 2, 5, 4]}',
        '```\n{"order": [1, 2, 3, 4, 5]}\n```',
    )
    return [{"answer.json": text.encode()} if text[0] == "{" else {"answer.txt": text.encode()} for text in texts]


def _read_answer(folder: Path) -> None:
    text = next(folder.iterdir()).read_bytes().decode("utf-8", "surrogateescape")
    try:
        read_order(text, 5)
    except ValueError as error:  # what it is to raise: it asks the model again, in these words
        str(error).encode()
    answer = parse_answer(text)
    json.dumps(answer.model_dump()).encode()
    answer.thought.encode()


_TABLES = ("scenes", "objects", "anchors", "routes/train")


def _shards() -> list[Case]:
    whole = _made(court.write_inputs)
    paths = {str(store.shard_path(Path(), table, court.SCENE)) for table in _TABLES}
    return [{path: raw} for path, raw in whole.items() if path in paths]


def _read_shard(folder: Path) -> None:
    path = next(p for p in folder.rglob("*.parquet"))
    table = next(t for t in _TABLES if store.shard_path(folder, t, court.SCENE) == path)
    info = store.read_info(path)
    if info is not None:
        assert isinstance(info.fingerprint, str)
        assert isinstance(info.parts, int)
        assert all(isinstance(k, str) and isinstance(v, int) for k, v in info.files.items())
        json.dumps(info.summary)
    store.read_scene(folder, table, court.SCENE).to_pylist()


_FINGERPRINT = "f" * 64
_NAV = f"media/{court.SCENE}/nav_a"


def _recording_rows() -> list[dict]:
    return [
        {
            "scene": court.SCENE, "nav_id": "nav_a", "view": "front", "modality": modality,
            "path": f"{_NAV}/front_{modality}.{suffix}",
            "sampling": "steps", "n_frames": 3, "fps": 15.0, "width": 16, "height": 16, "fov_deg": 90.0,
            "codec": "h264",
            "renderer": "gl", "device": "llvmpipe", "bytes": 4, "sha256": "0" * 64, "ok": True, "flags": ["dark"],
        }
        for modality, suffix in (("depth", "mkv"), ("rgb", "mp4"))
    ]  # fmt: skip


def _notes() -> list[Case]:
    rows = _recording_rows()
    note = json.dumps({"fingerprint": _FINGERPRINT, "recordings": rows}).encode()
    return [{f"{_NAV}/recording.json": note, **{row["path"]: b"xxxx" for row in rows}}]


def _find(folder: Path) -> None:
    from aerialdojo_gen.store.schemas import RECORDINGS
    from aerialdojo_gen.store.tables import check_table, from_rows

    rows = finished.find(folder, _NAV, _FINGERPRINT)
    if rows is not None:
        check_table(RECORDINGS, from_rows(RECORDINGS, rows))
        assert all((folder / row["path"]).resolve().is_relative_to(folder.resolve()) for row in rows)


def _recordings() -> list[Case]:
    camera = json.dumps(
        {"K": [[8, 0, 8], [0, 8, 8], [0, 0, 1]], "body_from_camera": np.eye(4).tolist(), "fov_deg": 90.0}
    )
    colour = np.arange(16 * 16 * 3, dtype=np.uint8).reshape(16, 16, 3)

    def videos(folder: Path) -> None:
        for modality, suffix in (("rgb", "mp4"), ("depth", "mkv")):
            with VideoWriter(folder / f"front_{modality}.{suffix}", modality, 16, 16, 15.0, comment=camera) as writer:
                for k in range(3):
                    writer.write(colour + k if modality == "rgb" else colour[..., 0].astype(np.uint16) + k)

    def pictures(folder: Path) -> None:
        for modality in ("rgb", "depth"):
            with PngWriter(folder / f"front_{modality}", comment=camera) as writer:
                for k in range(2):
                    writer.write(colour + k if modality == "rgb" else colour[..., 0].astype(np.uint16) + k)

    return [_made(videos), _made(pictures)]


def _read_recording(folder: Path) -> None:
    recording = read_recording(str(folder))
    for video in (*recording.rgb.values(), *recording.depth_m.values()):
        for k in range(min(len(video), 5)):
            assert np.asarray(video[k]).size
    json.dumps(recording.cameras)


def _journals() -> list[Case]:
    records = [
        {"task_id": f"t{k}", "episode": {"success": True, "spl": 0.5}, "steps": {"action": [1, 2, 0]}}
        for k in range(3)
    ]
    return [{"x.jsonl": b"".join(json.dumps(r).encode() + b"\n" for r in records)}]


def _read_journal(folder: Path) -> None:
    for record in journal.read(folder / "x.jsonl"):
        json.dumps(record).encode()


TARGETS: dict[str, Target] = {
    "annotations": Target(_annotations, _read_annotations),
    "pipeline": Target(_pipelines, _read_pipeline),
    "recipe": Target(_recipes, _build),
    "recipe-imported": Target(_imported_recipes, _build_imported, ".toml", names_the_file=False),
    "prop": Target(_props, _instantiate, "x.toml"),
    "materials": Target(_materials, _instantiate),
    "glb": Target(lambda: [{"U_Court_0.glb": _court_glb()}], _read_own),
    **{f"mesh-{s}": Target(_village(s), _read_mesh, names_the_file=False) for s in ("glb", "obj", "stl", "ply",
    "3ds")},
    "import-aerialdojo": Target(_aerialdojo, _import("aerialdojo", "."), ".json", names_the_file=False),
    "import-uav-on": Target(_written(lambda _: task_files.uav_on(2)), _import("uav-on"), ".json",
    names_the_file=False),
    "import-cityavos": Target(_written(task_files.cityavos), _import("cityavos"), ".json", names_the_file=False),
    "import-aerialvln": Target(_written(lambda _: task_files.aerialvln()), _import("aerialvln"), ".json",
    names_the_file=False),
    "import-openfly": Target(_written(lambda _: task_files.openfly()), _import("openfly"), ".json",
    names_the_file=False),
    "answer": Target(_answers, _read_answer, names_the_file=False),
    "shard": Target(_shards, _read_shard),
    "recording-note": Target(_notes, _find, ".json"),
    "recording": Target(_recordings, _read_recording),
    "journal": Target(_journals, _read_journal),
}  # fmt: skip


def laid_out(case: Case, folder: Path) -> None:
    """Write an input's files into an emptied folder."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, raw in case.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(raw)
