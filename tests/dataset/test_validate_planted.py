"""What a bad merge, a bad disk or a bad author could do to a release that passes every check of form."""

import hashlib

import cv2
import numpy as np
import pandas as pd
import pytest
from support.layout_checks import drawn
from support.planting import (
    check,
    check_of,
    definitions,
    edit_mesh,
    named,
    outcome_of,
    put,
    rename,
    retell,
    scene_data,
)
from support.releases import files_of

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.dataset.validate import ValidationOptions, validate
from aerialdojo_gen.pipeline.stages.work.split import key_of, nav_id

OBJECTS = "release/objects"


def objects_of(*ids):
    return sorted(f"object_id={k}" for k in ids)


def pictured(planted):
    return {row["object_id"]: row for row in planted.rows(OBJECTS) if row["reference_image"]}


def repaint(planted, object_id, change):
    """Change an object's picture, which is given as BGR."""

    def change_it(row):
        picture = cv2.imdecode(np.frombuffer(row["reference_image"], np.uint8), cv2.IMREAD_COLOR)
        row["reference_image"] = cv2.imencode(".png", np.ascontiguousarray(change(picture)))[1].tobytes()

    planted.edit(OBJECTS, change_it, lambda row: row["object_id"] == object_id)


def patched(picture):
    """A small thing painted over in the colour beside it."""
    picture[200:216, 40:56] = 255 - picture[200:216, 40:56]
    return picture


@pytest.mark.parametrize("renderer", ["auto", "pybullet"])
def test_pictures_swapped_or_copied(planted, renderer):
    """By the renderer that drew them, and by another one; of four pictures, one is its own."""
    rows = planted.rows(OBJECTS)
    data = scene_data(planted, pictures=4)
    four = data.sampled(data["objects"])
    pictures = [rows[row]["reference_image"] for row in four]
    swapped = {0: 1, 1: 0, 2: 0}
    for mine, other in swapped.items():
        rows[four[mine]]["reference_image"] = pictures[other]
    planted.write(OBJECTS, rows)
    data = scene_data(planted, pictures=4)
    asked = data.pipeline.reference_images.model_copy(update={"renderer": renderer})
    data.pipeline = data.pipeline.model_copy(update={"reference_images": asked})
    told = {fault.key: fault.found for fault in outcome_of(data, "image_redrawn").faults}
    names = [named(OBJECTS, rows[row]) for row in four]
    assert told == {names[a]: f"the picture of {names[b]}" for a, b in swapped.items()}


CHANGES = [
    (lambda picture: picture[..., ::-1], "image_redrawn", "channels BGR"),
    (lambda picture: picture[..., [1, 0, 2]], "image_redrawn", "channels RBG"),
    (lambda picture: picture[:, ::-1], "image_redrawn", "mirrored"),
    (lambda picture: picture[::-1], "image_redrawn", "upside down"),
    (lambda picture: picture[::-1, ::-1], "image_redrawn", "turned"),
    (lambda picture: np.roll(picture, 40, axis=1), "image_redrawn", "off on average"),
    (lambda picture: (picture * 0.8).astype(np.uint8), "image_redrawn", "off on average"),
    (patched, "image_redrawn", "pixels that are drawn otherwise"),
    (lambda picture: cv2.resize(picture, (160, 160)), "image_format", "160 x 160"),
    (lambda picture: cv2.cvtColor(picture, cv2.COLOR_BGR2BGRA), "image_format", "colour type 6"),
    (lambda picture: cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), "image_format", "colour type 0"),
]


@pytest.mark.parametrize("first", drawn([0, 4, 8], 1))
def test_pictures_that_were_changed(planted, first):
    """Four at a time: most others are as they were drawn, which tells of a few pixels."""
    changed = dict(zip(sorted(pictured(planted))[1:], CHANGES[first : first + 4], strict=False))
    for object_id, (change, *_) in changed.items():
        repaint(planted, object_id, change)
    report = validate(ValidationOptions(planted.release, (planted.scene,), pipeline=definitions()))
    # A smaller picture is too small for its box as well.
    found = {fault.key: (fault.check, fault.found) for fault in report.faults if fault.check != "image_box"}
    assert found.keys() == {f"object_id={object_id}" for object_id in changed}
    for object_id, (_, check_name, words) in changed.items():
        by, said = found[f"object_id={object_id}"]
        assert by == check_name
        assert words in said


def test_a_sample_of_routes_or_pictures_is_of_so_many_and_always_the_same(planted):
    routes = planted.rows("routes/train") + planted.rows("routes/test")
    for table, option, every in (("routes", "sample", len(routes)), ("objects", "pictures", len(pictured(planted)))):
        for most in (0, 2, None):
            first, again = (scene_data(planted, **{option: most}) for _ in range(2))
            drawn_rows = first.sampled(first[table]).tolist()
            assert len(drawn_rows) == (every if most is None else most)
            assert drawn_rows == again.sampled(again[table]).tolist()
    assert outcome_of(scene_data(planted, pictures=2), "image_redrawn").rows == 2


def swap_colours(document):
    """Exchange what two plain materials are drawn with, names left as they are."""
    plain = [m for m in document["materials"] if "baseColorFactor" in m["pbrMetallicRoughness"] and "#" in m["name"]]
    a, b = plain[0], plain[-1]
    for key in ("pbrMetallicRoughness", "extras"):
        a[key], b[key] = b[key], a[key]


def swap_materials(document):
    """Paint every triangle of the scene with the next material."""
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["material"] = (primitive["material"] + 1) % len(document["materials"])


def show_a_ghost(document):
    """Show a thing once more, at a place of its own."""
    document["nodes"].append({"name": "ghost", "mesh": 0, "translation": [3.0, 0.0, 0.0]})
    document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1)


def named_node(document, start):
    return next(node for node in document["nodes"] if node["name"].startswith(start))


SAYING_SOMETHING_ELSE = [
    (lambda d: d["nodes"][0].update(translation=[5.0, 0.0, 0.0]), "mesh_moved"),
    (lambda d: d["nodes"][0].update(scale=[1.1, 1.1, 1.1]), "mesh_moved"),
    (lambda d: d["nodes"][0].pop("rotation"), "mesh_moved"),
    (lambda d: named_node(d, "bench_").update(rotation=[0.0, 0.0, 1.0, 0.0]), "mesh_moved"),
    (show_a_ghost, "mesh_moved"),
    (lambda d: d["scenes"].insert(0, {"nodes": []}), "mesh_moved"),
    (lambda d: d.update(animations=[{"channels": [], "samplers": []}]), "mesh_moved"),
    (lambda d: named_node(d, "bench_").update(rotation=[0.0, 1.0]), "mesh_moved"),
    (lambda d: d["materials"][0]["extras"].update(colour=[1, 2, 3]), "mesh_colours"),
    (lambda d: d["buffers"][0].update(uri="elsewhere.bin"), "mesh_extent"),
    (lambda d: d["accessors"][0]["max"].__setitem__(0, 1e4), "mesh_extent"),
]
SHOWING_SOMETHING_ELSE = [
    (lambda d: named_node(d, "bench_").update(translation=[0.0, 0.0, 0.3]), "mesh_moved"),
    (swap_colours, "mesh_colours"),
    (swap_materials, None),
]


@pytest.mark.parametrize("case", drawn(SAYING_SOMETHING_ELSE, 2))
def test_a_mesh_that_says_something_else(planted, case):
    change, found_by = case
    edit_mesh(planted, change)
    assert check_of(planted, "scenes") == {found_by: [f"scene={planted.scene}"]}


@pytest.mark.parametrize("case", drawn(SHOWING_SOMETHING_ELSE, 1))
def test_a_mesh_that_shows_something_else_contradicts_pictures_and_words_alone(planted, case):
    change, found_by = case
    edit_mesh(planted, change)
    found = check(planted, pictures=None)
    if found_by:
        assert found.pop(found_by) == [f"scene={planted.scene}"]
    else:
        assert found["image_redrawn"] == objects_of(*pictured(planted))
    assert set(found) <= {"image_redrawn", "object_words", "object_claims"}


# Tables in which words stand.
SAID = ("landmarks", "objects", "tasks")
VAN, TRUCK, MAILBOX, HYDRANT, BIN = 0, 1, 4, 5, 8


@pytest.mark.parametrize(
    "changes",
    [
        # Words of two objects, swapped.
        [(VAN, "name", MAILBOX), (MAILBOX, "name", VAN), (HYDRANT, "name", BIN), (BIN, "name", HYDRANT)],
        [(VAN, "description", TRUCK), (TRUCK, "description", VAN),
         (MAILBOX, "description", HYDRANT), (HYDRANT, "description", MAILBOX)],
        # A word that is not so.
        [(VAN, "name", "red", "blue"), (BIN, "name", "litter bin", "bench")],
        [(VAN, "description", "red delivery", "green delivery")],
        [(VAN, "description", "white stripe", "black stripe")],
    ],
)  # fmt: skip
def test_words_that_are_not_so(planted, changes):
    rows = {row["object_id"]: row for row in planted.rows(OBJECTS)}
    for object_id, told, of, *new in changes:
        text = rows[object_id][told].replace(of, *new) if new else rows[of][told]
        assert text != rows[object_id][told]
        retell(planted, object_id, **{told: text})
    assert check_of(planted, *SAID) == {"object_words": objects_of(*(object_id for object_id, *_ in changes))}


def test_words_of_a_look_that_another_variant_has(planted):
    """The catalogue's own phrase, of parts that this bin does not have."""
    text = "A green litter bin on the lawn by the path. It has a hood over its mouth."
    retell(planted, BIN, description=text)
    assert check_of(planted, *SAID) == {"object_words": objects_of(BIN)}
    retell(planted, BIN, description=text.partition(". ")[0] + ".")
    assert check_of(planted, *SAID) == {}


def test_texts_with_rubbish_in_them(planted):
    own = [row["description"] for row in planted.rows(OBJECTS)][:4]
    texts = [own[0].replace(" ", "  ", 1), f" {own[1]}", f"{own[2]}\x00", own[3].replace("park", "p�rk")]
    for object_id, text in enumerate(texts):
        retell(planted, object_id, description=text)
    assert check_of(planted, *SAID)["text_form"] == objects_of(*range(4))


def test_a_landmark_called_after_another_thing(planted):
    landmark = planted.rows("release/landmarks")[0]
    planted.edit("release/landmarks", put("name", "fire hydrant"))
    for side in ("train", "test"):
        planted.edit_all(f"tasks/{side}", put("landmark", "fire hydrant"), lambda _: True)
    found = check_of(planted, *SAID)
    assert found["landmark_name"] == [named("release/landmarks", landmark)]
    # Texts that name the hydrant may now mean the landmark.
    assert set(found) <= {"landmark_name", "object_words"}


def test_an_id_that_begins_with_its_target(planted):
    row = planted.rows("routes/train")[0]
    told = f"{planted.scene}-{row['target_object_id']:02x}{row['nav_id'][-10:]}"
    keys = rename(planted, lambda route: told if route["nav_id"] == row["nav_id"] else route["nav_id"])
    assert check(planted, use_meshes=False) == {"nav_id_of_salt": keys}


ANOTHERS = definitions().model_copy(update={"split": Pipeline().split})


TELLING = {
    "target first": lambda row, rest: f"{row['target_object_id']:02x}{rest[2:]}",
    "target last": lambda row, rest: f"{rest[:-1]}{row['target_object_id'] % 16:x}",
    "start within": lambda row, rest: f"{rest[:5]}{row['start_object_id'] % 16:x}{rest[6:]}",
    "length first": lambda row, rest: f"{int(row['length_m']) % 256:02x}{rest[2:]}",
    "counted by target": lambda row, rest: f"{row['target_object_id'] * 2**32 + int(rest[:8], 16):012x}",
    "target at the end": lambda row, rest: f"{rest[:9]}{row['target_object_id'] * 17:03x}",
}


@pytest.mark.parametrize("told", [None, *drawn(TELLING, 1)])
def test_ids_that_go_with_what_is_withheld(planted, told):
    """Another pipeline's salt is not known: what the ids tell is then found by chance's own measure."""
    if told:
        rename(planted, lambda row: f"{planted.scene}-{TELLING[told](row, row['nav_id'][-12:])}")
    found = check(planted, pipeline=ANOTHERS, use_meshes=False)
    assert set(found) == ({"telling_digits"} if told else set())


def test_ids_that_anybody_could_compute(planted):
    def pair(row):
        return f"{row['start_object_id']}_{row['start_anchor_id']}__{row['target_object_id']}"

    def digest(text):
        return hashlib.blake2b(f"{planted.scene}/{text}".encode(), digest_size=6).hexdigest()

    keys = rename(planted, lambda row: f"{planted.scene}-{digest(pair(row))}")
    assert check(planted, use_meshes=False) == {"nav_id_guessed": keys}


def test_the_salt_names_the_release_and_stands_nowhere_in_it(smoke):
    split = definitions().split
    row = pd.read_parquet(next((smoke / "release" / "routes").glob("*/*.parquet"))).iloc[0]
    pair = f"{row['start_object_id']}_{row['start_anchor_id']}__{row['target_object_id']}"
    assert row["nav_id"] == nav_id(row["scene"], pair, key_of(split.salt, definitions().seed))
    assert all(split.salt.encode() not in raw for raw in files_of(smoke / "release").values())
