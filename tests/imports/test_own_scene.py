"""A scene of one's own by the commands alone: what each of them advises can be pasted and works."""

from __future__ import annotations

import dataclasses
import json
import re
import shlex

import numpy as np
import pytest
import trimesh
from support import foreign
from support.command_line import said
from support.layout_checks import catalogue

from aerialdojo_gen.annotations.draft import AnnotationDrafter, DraftOptions, choose_landmarks
from aerialdojo_gen.annotations.phrases import group_of
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.imports.forms import form_of, grown, is_unnamed
from aerialdojo_gen.imports.import_mesh import import_mesh
from aerialdojo_gen.imports.naming import Naming, words_in
from aerialdojo_gen.store.shards import read_scene


def pasted(text: str, begin: str) -> list[str]:
    """The arguments of the command that a line advises."""
    (line,) = [line for line in text.splitlines() if begin in line]
    program, *arguments = shlex.split(line.partition(begin)[2].strip())
    assert program == "aerialdojo-gen"
    return arguments


def yard(*bodies: tuple[str, trimesh.Trimesh, tuple[float, float, float]]) -> trimesh.Scene:
    scene = trimesh.Scene()
    for name, body, place in bodies:
        scene.add_geometry(body.copy().apply_translation(place), node_name=name)
    return scene


def box(*size: float) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty working directory whose name has to be quoted."""
    folder = tmp_path / "my place"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.delenv("AERIALDOJO_DATA", raising=False)
    return folder


def done(capsys, *arguments: object) -> tuple[str, str]:
    """What a command prints that succeeds."""
    code, out, err = said(capsys, *arguments)
    assert code == 0, err
    return out, err


def added(capsys, scene: trimesh.Scene, name: str, *options: str) -> str:
    scene.export(f"{name}.glb")
    return done(capsys, "add-scene", name, f"{name}.glb", "--up", "z", "--project", "our scenes", *options)[0]


def drafted(place, name: str) -> dict:
    return json.loads((place / f"our scenes/annotations/{name}.json").read_text())


@pytest.mark.pipeline
def test_from_a_mesh_to_tasks_by_what_the_commands_advise_past_a_scene_without_annotations(place, capsys):
    out = added(capsys, foreign.village(), "Village")
    printed, err = done(capsys, *pasted(out, "next: "))
    assert printed.strip() == str(place / "our scenes/annotations/Village.json")
    assert "up to 7 objects by 2 landmarks" in err  # eight houses and a tower
    draft = drafted(place, "Village")
    assert len(draft["landmarks"]) == 2
    assert 2 <= len(draft["objects"]) <= 7
    run = pasted(added(capsys, foreign.village(), "Hamlet"), "then: ")
    _, err = done(capsys, *run, "--workers", "1", "--quiet")
    (left_out,) = [line for line in err.splitlines() if "left out" in line]
    assert left_out.startswith("left out: Hamlet has no annotations")
    released = [p.name for p in (place / "our scenes/data/release/tasks").rglob("*.parquet")]
    assert released
    assert all("Village" in name for name in released)
    # Asked for by its full name it is owed; the one that is there is finished all the same.
    code, _, err = said(capsys, *run, "--workers", "1", "--scene", "Hamlet", "--scene", "Village")
    assert code == 1
    assert "the other scenes are finished" in err
    code, _, err = said(capsys, "plan", "--pipeline", run[1], "--data", run[3], "--scene", "Hamlet")
    assert code == 1
    assert "build-scenes" not in err  # nothing is begun that cannot be finished
    advice = err.partition("draft them: ")[2].partition(" or make them by hand: ")
    assert shlex.split(advice[0]) == ["aerialdojo-gen", "annotate-draft", "Hamlet", "--pipeline", run[1]]
    by_hand = ["aerialdojo-gen", "annotate", "--scene", "Hamlet", "--pipeline", run[1], "--data", run[3]]
    assert shlex.split(advice[2].splitlines()[0]) == by_hand
    # A pipeline whose stages begin later leaves it out as well.
    later = (place / run[1]).with_name("later.toml")
    later.write_text((place / run[1]).read_text().replace('"build-scenes", "annotate-import", "anchor-sample", ', ""))
    assert "annotate-import" not in later.read_text()
    _, err = done(capsys, "run", later, "--data", run[3], "--workers", "1", "--replace")
    assert err.count("left out: Hamlet") == 1
    # Numbers that cannot be had are the most.
    done(capsys, *shlex.split(advice[0])[1:], "--objects", "30", "--landmarks", "1", "--quiet")
    assert len(drafted(place, "Hamlet")["objects"]) >= 2


BARN = ("Barn", box(8, 6, 5), (0, 0, 2.5))
# A barn in a shed: nothing of it can be looked at. Flat things without a name that is a word are slabs.
INSIDE = yard(("Shed", box(12, 10, 9), (0, 0, 4.5)), ("Barn", box(8, 6, 5), (1, 0, 2.5)),
              ("Mesh_012", box(40, 40, 0.1), (0, 0, 0)))  # fmt: skip
WHY = r"not taken: 1 of ground, slabs or scraps, 1 without 3 viewpoints at 1 m \(shut in, or below ground\)"


@pytest.mark.parametrize(("bodies", "why"), [(INSIDE, WHY), (yard(BARN), "nothing in it can be drafted")])
def test_what_cannot_be_drafted_says_why_and_what_to_do(place, capsys, bodies, why):
    code, _, err = said(capsys, *pasted(added(capsys, bodies, "Odd"), "next: "))
    assert code == 1
    assert re.search(why, err), err
    assert "aerialdojo-gen annotate --scene Odd --pipeline 'our scenes/pipeline.toml'" in err
    assert not re.search(r"ask for|--objects", err)
    assert not list((place / "our scenes/annotations").iterdir())


def test_one_thing_beside_a_landmark_is_taken_with_a_warning(place, capsys):
    farm = yard(BARN, ("Well", box(2, 2, 2), (15, 3, 1)))
    _, err = done(capsys, *pasted(added(capsys, farm, "Farm"), "next: "))
    assert "a single object makes no task" in err
    assert "aerialdojo-gen annotate --scene Farm --pipeline 'our scenes/pipeline.toml'" in err
    draft = drafted(place, "Farm")
    assert {draft["landmarks"][0]["name"], draft["objects"][0]["name"].split()[-1]} == {"barn", "well"}


@pytest.mark.pipeline
def test_drafts_are_true_or_silent(place, capsys):
    grey = (140, 140, 140, 255)
    bodies = [(f"Truck.{k:03d}", box(6, 2.5, 3), (12.0 * (k % 4), 14.0 * (k // 4), 1.5)) for k in range(12)]
    # The foot of the tower reaches under the truck beside it; a crate stands on the terrace.
    tower = trimesh.util.concatenate(
        [trimesh.creation.box((4, 4, 20)), trimesh.creation.box((14, 6, 0.2)).apply_translation((5, 0, -9.9))]
    )
    bodies += [
        ("Tower", tower, (-20, 0, 10)), ("Lorry", box(5, 2, 3), (-14.5, 0, 1.7)),
        ("Terrace", box(9, 7, 2), (-20, 28, 1)), ("Crate_a3f9c", box(2, 2, 2), (-20, 28, 3)),
        ("leaves", box(4, 4, 3), (22, -12, 1.5)), ("City_c3e0b", box(8, 6, 6), (44, -14, 3)),
        ("Mesh_012", trimesh.creation.cylinder(1.5, 4), (0, -14, 2)), ("a3f9c", box(3, 3, 2), (10, -14, 1)),
    ]  # fmt: skip
    for name, body, _ in bodies:
        body.visual.face_colors = (60, 150, 60, 255) if name == "leaves" else grey
    draft = pasted(added(capsys, yard(*bodies), "Depot"), "next: ")
    _, err = done(capsys, *draft)
    made = drafted(place, "Depot")
    texts = [entry["name"] for entry in made["objects"]]
    names = "\n".join([*texts, *(mark["name"] for mark in made["landmarks"])])
    assert not re.search(r"\b(mesh|c3e0b|ceb|c e b|a3f9c|afc|a f c|\d+)\b", names), names
    assert not re.search(r"\ba (low |tall |long )*(green )?leaves", names), names
    assert {entry["category"] for entry in made["objects"]} >= {"truck", "cylinder", "box"}
    assert {entry["name"] for entry in made["objects"] if is_unnamed(entry["node"], entry["category"])} == {
        "grey cylinder", "grey box",
    }  # fmt: skip
    assert "needs review" in err
    assert {mark["name"] for mark in made["landmarks"]}.isdisjoint({"truck", "grey truck", "object"})
    done(capsys, "annotate-import", "--pipeline", draft[-1], "--data", "data", "--workers", "1")
    rows = read_scene(place / "data", "objects", "Depot").to_pylist()
    relations = {
        (row["mesh_node"].split("_")[0], claim["key"], thing["node"].split("_")[0])
        for row in rows for claim in json.loads(row["claims"]) for thing in claim.get("things", [])
    }  # fmt: skip
    # What the crate stands on is not under it, and the lorry is not on the tower.
    assert relations.isdisjoint({("terrace", "under", "crate"), ("lorry", "on", "tower")})
    assert relations


def test_what_cannot_be_told_apart_says_with_what_it_is_confused(project):
    crates = [(f"Crate.{k}", box(2, 2, 2), (60.0 + 2.4 * (k % 3), 2.4 * (k // 3), 1.0)) for k in range(9)]
    bodies = (("Tower", box(5, 5, 20), (0, 0, 10)), *crates)
    nodes = [foreign.raw(body.apply_translation(place), name) for name, body, place in bodies]
    adopted, _ = import_mesh("Stack", nodes)
    vocabulary = Vocabulary(dataclasses.replace(adopted, imported=True), catalogue())
    drafter = AnnotationDrafter(vocabulary, choose_landmarks(vocabulary, 1), DraftOptions(max_per_category=30))
    chosen = []
    made = drafter.objects(9, lambda: chosen.append(1))
    assert len(chosen) == len(made) < 9
    assert len(drafter.confusions) == drafter.rejections["indistinguishable from others of their category"] > 0
    for node, others in drafter.confusions:
        assert set(others) <= {f"crate_{k:04d}" for k in range(9)} - {node}
    confused = r"of their category \(crate_\d{4} with crate_\d{4}( and \d more)?; "
    assert re.search(confused, drafter.rejection_summary())


def test_a_table_says_what_nodes_are_called(place, capsys):
    rows = ["pattern,name,category,plural", "mesh_0*,garden shed,shed,", "a3f9*,hedges,,a row of", "*,thing,,"]
    (place / "names.csv").write_text("\n".join(rows) + "\n")
    nodes = [(f"mesh_0{k}", box(4, 3, 3), (12 * k, 0, 1.5)) for k in range(3)]
    nodes += [("a3f9c", box(8, 1, 2), (8, 8, 1)), ("Fountain", box(3, 3, 2), (0, 12, 1))]
    out = added(capsys, yard(*nodes), "Garden", "--names", "names.csv")
    done(capsys, *pasted(out, "next: "))
    made = drafted(place, "Garden")
    names = [*(m["name"] for m in made["landmarks"]), *(entry["name"] for entry in made["objects"])]
    assert any(name.endswith("garden shed") for name in names)
    assert not any("fountain" in name for name in names)
    # The same table as TOML; a row that fits nothing is told.
    (place / "names.toml").write_text('"mesh_0*" = {name = "shed"}\n"Tower*" = "red tower"\n')
    printed, _ = done(capsys, "add-scene", "Two", "Garden.glb", "--up", "z", "--names", "names.toml")
    assert "'Tower*' fits no node and no material of the file" in printed
    assert "mesh_0" not in printed
    (place / "names.csv").write_text("pattern,name\n*,mesh_7\n")
    code, _, err = said(capsys, "add-scene", "Other", "Garden.glb", "--up", "z", "--names", "names.csv")
    assert code == 1
    assert "names.csv: line 2: name 'mesh_7' must be letters, spaces and hyphens" in err


@pytest.mark.parametrize(
    ("node", "words"),
    [
        ("Building.012", "building"), ("StreetLamp_03", "street lamp"), ("Clock Tower", "clock tower"),
        ("House03", "house"), ("City_c3e0b", "city"), ("Mesh_012", ""), ("Object.003", ""), ("a3f9c", ""),
        ("deadbeef", ""), ("Cube.001", ""), ("geometry_0", ""), ("way/123456", ""), ("node_x2y", ""), ("grp_mdl", ""),
        ("Cafe_LOD0", "cafe"), ("3f2504e0-4f89-11d3-9a0c-0305e82c3301", ""), ("Bus.Mesh", "bus"), ("", ""),
        ("tree_tree_7", "tree"), ("オブジェクト", ""), ("TrafficCone_2", "traffic cone"), ("Cone.004", ""),
        ("Mülltonne.001", "mülltonne"), ("SM_Bench_03a", "bench"),
    ],
)  # fmt: skip
def test_words_are_read_out_of_node_names_and_nothing_else(node, words):
    assert " ".join(words_in(node)) == words


@pytest.mark.parametrize(
    ("node", "materials", "category", "attributes"),
    [
        ("DeliveryVan_Blue", {}, "delivery_van", {"colour": "blue"}),
        ("DeliveryVan_Red", {"Metal": 0.9}, "delivery_van", {"colour": "red", "material": "metal"}),
        ("Tree_Oak_LOD0", {"Wood": 0.9}, "oak_tree", {}), ("SM_Rock_Large_01", {}, "rock", {"size": "large"}),
        ("old_rusty_barrel_3", {}, "barrel", {"state": "rusty"}), ("Haus_3", {}, "haus", {}),
        ("Mülltonne.001", {}, "mulltonne", {"called": "mülltonne"}), ("Street_Furniture", {}, "street_furniture", {}),
        ("", {"Leaves_01": 0.8, "Bark": 0.2}, "tree", {}), ("", {"M_Concrete": 1.0}, "", {"material": "concrete"}),
        ("", {"Wall_Plaster": 0.6, "RoofTiles": 0.4}, "house", {}), ("Mesh_1", {"Wall": 1.0}, "", {}),
        ("Prop_Chair", {"Leather": 0.4}, "chair", {}), ("leaves", {}, "leaves", {}),
    ],
)  # fmt: skip
def test_names_of_nodes_and_materials_are_a_noun_and_attributes(node, materials, category, attributes):
    name = Naming().name_of(node, materials)
    assert (name.category, name.attributes) == (category, attributes)


def test_pieces_of_a_merged_mesh_are_put_together_and_named_by_their_materials(tmp_path):
    ball, post = trimesh.creation.icosphere(2, 1.8), trimesh.creation.cylinder(0.25, 3)
    pieces = [
        ("Asphalt", box(60, 60, 0.2), (0, 0, -0.1)), ("Bark", post, (9, 9, 1.5)), ("Leaves_01", ball, (9, 9, 4.2)),
        ("Wall_White", box(8, 6, 4), (-15, 0, 2)), ("RoofTiles", box(8.6, 6.8, 0.4), (-15, 0, 4.2)),
        ("CarPaint_Blue", box(4.2, 1.8, 1.4), (0, -9, 0.75)), ("M_Concrete", box(10, 0.3, 1.8), (0, 14, 0.9)),
        ("Material.001", ball, (14, -9, 1.6)),
    ]  # fmt: skip
    paints = ["0.3 0.3 0.3", "0.4 0.3 0.2", "0.3 0.5 0.2", "0.9 0.9 0.9", "0.6 0.2 0.2", "0.2 0.3 0.7", "0.6 0.6 0.6",
              "0.6 0.2 0.6"]  # fmt: skip
    lines, n = ["mtllib m.mtl", "o Merged"], 1
    for material, body, place in pieces:
        lines += [f"usemtl {material}", *(f"v {x} {y} {z}" for x, y, z in (body.vertices + place).tolist())]
        lines += [f"f {a} {b} {c}" for a, b, c in (body.faces + n).tolist()]
        n += len(body.vertices)
    (tmp_path / "merged.obj").write_text("\n".join(lines))
    library = [f"newmtl {m}\nKd {paint}" for (m, *_), paint in zip(pieces, paints, strict=True)]
    (tmp_path / "m.mtl").write_text("\n".join(library))
    scene, _ = import_mesh("Merged", foreign.read_here(tmp_path / "merged.obj"))
    looks = [(i.category, i.attributes.get("material", ""), i.attributes["colour"]) for i in scene.instances]
    assert sorted(looks) == [
        ("ball", "", "purple"), ("car", "", "blue"), ("house", "", "white"), ("slab", "", "grey"),
        ("tree", "", "green"), ("wall", "concrete", "grey"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("body", "form"),
    [(box(1, 1, 2), "box"), (box(8, 6, 4), "building"), (box(8, 3, 2), "block"),
     (box(6, 0.3, 2), "wall"), (box(0.2, 0.2, 1.2), "post"),
     (box(0.2, 0.2, 4), "pole"), (trimesh.creation.cylinder(0.4, 1), "drum"), (trimesh.creation.icosphere(2), "ball"),
     (trimesh.creation.icosphere(3, 4).slice_plane((0, 0, 1), (0, 0, 1)), "mound"), (box(2, 2, 12), "tower"),
     (trimesh.creation.annulus(2, 4, 9).slice_plane((0, 0, 0), (1, 0, 0)), "object")],
)  # fmt: skip
def test_what_has_no_name_has_a_form_that_it_has(body, form):
    assert form_of(np.asarray(body.vertices)) == form
    assert grown(form, "grey and brown", 3.0) == form
    assert grown(form, "green", 3.0) == {"ball": "tree", "mound": "tree", "wall": "hedge"}.get(form, form)


def test_what_is_many_is_told_as_a_group():
    assert {group_of(name) for name in ("bus", "glass", "truss", "lens", "tower")} == {""}
    assert {group_of(name) for name in ("autumn leaves", "trees", "people")} == {"a group of"}
    assert [group_of(name) for name in ("grass", "rubble")] == ["a patch of", "a heap of"]
