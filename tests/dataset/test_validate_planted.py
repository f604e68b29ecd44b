"""What a bad merge, a bad disk or a bad author could do to a release that passes every check of form."""

import hashlib

import cv2
import numpy as np
import pytest
from support.planting import check, definitions, edit_mesh, poses, refly, rename, retell

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.dataset.validate import ValidationOptions, validate
from aerialdojo_gen.dataset.validate.detours import _pieces
from aerialdojo_gen.pipeline.stages.work.task_ids import key_of, nav_id
from aerialdojo_gen.store.schemas import APPROACH

OBJECTS = "release/objects"
LEFT_1, RIGHT_1, UP_1, UP_2, DOWN_1, DOWN_2 = 4, 7, 10, 11, 12, 13


def objects_of(*ids):
    return sorted(f"object_id={k}" for k in ids)


def pictured(planted):
    return {row["object_id"]: row for row in planted.rows(OBJECTS) if row["reference_image"]}


def repaint(planted, object_id, change):
    """Change an object's picture, which is given as BGR."""

    def replace(row):
        picture = cv2.imdecode(np.frombuffer(row["reference_image"], np.uint8), cv2.IMREAD_COLOR)
        row["reference_image"] = cv2.imencode(".png", np.ascontiguousarray(change(picture)))[1].tobytes()

    planted.edit(OBJECTS, replace, lambda row: row["object_id"] == object_id)


def patched(picture):
    """A small thing painted over in the colour beside it."""
    picture[200:216, 40:56] = 255 - picture[200:216, 40:56]
    return picture


@pytest.mark.parametrize("renderer", ["auto", "pybullet"])
def test_pictures_swapped_or_copied(planted, renderer):
    """By the renderer that drew them, and by another one."""
    rows = pictured(planted)
    first, second, third = sorted(rows)[:3]
    swapped = {first: rows[second], second: rows[first], third: rows[first]}
    for mine, other in swapped.items():
        planted.edit(
            OBJECTS, lambda row, other=other: row.update(reference_image=other["reference_image"]),
            lambda row, mine=mine: row["object_id"] == mine,
        )  # fmt: skip
    drawn = definitions().reference_images.model_copy(update={"renderer": renderer})
    pipeline = definitions().model_copy(update={"reference_images": drawn})
    report = validate(ValidationOptions(planted.release, (planted.scene,), pipeline=pipeline))
    told = {fault.key: fault.found for fault in report.faults}
    assert {fault.check for fault in report.faults} == {"image_redrawn"}
    assert told == {
        f"object_id={a}": f"the picture of object_id={b}"
        for a, b in ((first, second), (second, first), (third, first))
    }


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


@pytest.mark.parametrize("first", [0, 4, 8])
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


def test_a_sample_of_pictures_is_drawn_anew(planted):
    def judged(**options):
        report = validate(ValidationOptions(planted.release, (planted.scene,), pipeline=definitions(), **options))
        return next(outcome.rows for outcome in report.outcomes if outcome.check == "image_redrawn")

    assert [judged(pictures=n) for n in (0, 2, None)] == [0, 2, len(pictured(planted))]


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


def named(document, start):
    return next(node for node in document["nodes"] if node["name"].startswith(start))


@pytest.mark.parametrize(
    ("change", "found_by"),
    [
        (lambda d: d["nodes"][0].update(translation=[5.0, 0.0, 0.0]), "mesh_moved"),
        (lambda d: d["nodes"][0].update(scale=[1.1, 1.1, 1.1]), "mesh_moved"),
        (lambda d: d["nodes"][0].pop("rotation"), "mesh_moved"),
        (lambda d: named(d, "bench_").update(translation=[0.0, 0.0, 0.3]), "mesh_moved"),
        (lambda d: named(d, "bench_").update(rotation=[0.0, 0.0, 1.0, 0.0]), "mesh_moved"),
        (show_a_ghost, "mesh_moved"),
        (lambda d: d["scenes"].insert(0, {"nodes": []}), "mesh_moved"),
        (lambda d: d.update(animations=[{"channels": [], "samplers": []}]), "mesh_moved"),
        (lambda d: named(d, "bench_").update(rotation=[0.0, 1.0]), "mesh_moved"),
        (swap_colours, "mesh_colours"),
        (lambda d: d["materials"][0]["extras"].update(colour=[1, 2, 3]), "mesh_colours"),
        (lambda d: d["buffers"][0].update(uri="elsewhere.bin"), "mesh_extent"),
        (lambda d: d["accessors"][0]["max"].__setitem__(0, 1e4), "mesh_extent"),
        (swap_materials, "image_redrawn"),
    ],
)  # fmt: skip
def test_a_mesh_that_says_something_else(planted, change, found_by):
    edit_mesh(planted, change)
    found = check(planted, pictures=None)
    wanted = [f"scene={planted.scene}"] if found_by != "image_redrawn" else objects_of(*pictured(planted))
    assert found[found_by] == wanted
    # What is drawn otherwise is seen in the pictures too, and is not what the words say.
    assert set(found) <= {found_by, "image_redrawn", "object_words", "object_claims"}


VAN, TRUCK, MAILBOX, HYDRANT, SHELTER, BIN = 0, 1, 4, 5, 7, 8


@pytest.mark.parametrize(
    "swaps",
    [
        [((VAN, MAILBOX), "name"), ((HYDRANT, BIN), "name")],
        [((VAN, TRUCK), "description"), ((MAILBOX, HYDRANT), "description")],
    ],
)
def test_words_of_two_objects_swapped(planted, swaps):
    rows = {row["object_id"]: row for row in planted.rows(OBJECTS)}
    for ids, change in swaps:
        for mine, other in (ids, ids[::-1]):
            retell(planted, mine, **{change: rows[other][change]})
    assert check(planted) == {"object_words": objects_of(*(k for ids, _ in swaps for k in ids))}


@pytest.mark.parametrize(
    "changes",
    [
        [(VAN, "name", "red", "blue"), (BIN, "name", "litter bin", "bench")],
        [(VAN, "description", "red delivery", "green delivery")],
        [(VAN, "description", "white stripe", "black stripe")],
    ],
)
def test_a_word_that_is_not_so(planted, changes):
    rows = {row["object_id"]: row for row in planted.rows(OBJECTS)}
    for object_id, change, old, new in changes:
        text = rows[object_id][change]
        assert old in text
        retell(planted, object_id, **{change: text.replace(old, new)})
    assert check(planted) == {"object_words": objects_of(*(object_id for object_id, *_ in changes))}


def test_words_of_a_look_that_another_variant_has(planted):
    """The catalogue's own phrase, of parts that this bin does not have."""
    text = "A green litter bin on the lawn by the path. It has a hood over its mouth."
    retell(planted, BIN, description=text)
    assert check(planted) == {"object_words": objects_of(BIN)}
    retell(planted, BIN, description=text.partition(". ")[0] + ".")
    assert check(planted) == {}


def test_texts_with_rubbish_in_them(planted):
    own = [row["description"] for row in planted.rows(OBJECTS)][:4]
    texts = [own[0].replace(" ", "  ", 1), f" {own[1]}", f"{own[2]}\x00", own[3].replace("park", "p�rk")]
    for object_id, text in enumerate(texts):
        retell(planted, object_id, description=text)
    assert check(planted)["text_form"] == objects_of(*range(4))


def test_a_landmark_called_after_another_thing(planted):
    landmark = planted.rows("release/landmarks")[0]
    planted.edit("release/landmarks", lambda row: row.update(name="fire hydrant"))
    for side in ("train", "test"):
        planted.edit_all(f"tasks/{side}", lambda task: task.update(landmark="fire hydrant"), lambda _: True)
    found = check(planted)
    assert found["landmark_name"] == [f"landmark_id={landmark['landmark_id']}"]
    # Texts that name the hydrant may now mean the landmark.
    assert set(found) <= {"landmark_name", "object_words"}


def longer(planted, insert, at=0):
    """A route with needless moves in it, measured anew; it keeps its setting and its budget."""
    limits = {"base": (30, 90), "standard": (60, 180)}
    for row in planted.rows("routes/train"):
        longest, budget = limits[row["setting"]]
        new = refly(row, [*row["action"][:at], *insert, *row["action"][at:]])
        if new["length_m"] >= longest or new["n_actions"] > budget or row["action"][at] == APPROACH:
            continue
        rows = [new if old["nav_id"] == row["nav_id"] else old for old in planted.rows("routes/train")]
        planted.write("routes/train", rows)
        found = check(planted)
        # Where the moves end at a wall, they are told as a collision: another route then.
        if not set(found) & {"route_collision", "out_of_bounds"}:
            return new, found
        planted.write("routes/train", [row if one["nav_id"] == row["nav_id"] else one for one in rows])
    raise AssertionError("no route has room for the moves")


@pytest.mark.parametrize("insert", [[UP_1, DOWN_1], [LEFT_1, RIGHT_1], [UP_2, UP_2, UP_2, DOWN_2, DOWN_2, DOWN_2]])
def test_a_route_longer_than_it_need_be_with_right_figures(planted, insert):
    row, found = longer(planted, insert)
    assert found["needless_piece"] == [f"nav_id={row['nav_id']}"]
    assert set(found) <= {"needless_piece", "min_clearance", "long_way_round"}


def test_a_long_way_round_is_found_without_its_corners(planted):
    row, _ = longer(planted, [UP_2, UP_2, UP_2, DOWN_2, DOWN_2, DOWN_2])
    assert check(planted, sample=0)["long_way_round"] == [f"nav_id={row['nav_id']}"]


def test_pieces_are_the_shortest_that_are_worth_it(planted):
    square = np.array([[0, 0, 0], [5, 0, 0], [5, 2, 0], [5, 0, 0], [9, 0, 0], [9, 0, 3.0]])
    assert _pieces(square) == [(1, 3, 4.0, 0.0)]
    straight = poses(planted.rows("routes/train")[0])[:1, :3] + np.arange(4)[:, None] * [1.0, 0.0, 0.0]
    assert _pieces(straight) == []


def test_an_id_that_begins_with_its_target(planted):
    row = planted.rows("routes/train")[0]
    told = f"{planted.scene}-{row['target_object_id']:02x}{row['nav_id'][-10:]}"
    keys = rename(planted, lambda route: told if route["nav_id"] == row["nav_id"] else route["nav_id"])
    assert check(planted) == {"nav_id_of_salt": keys}


def turns(digits, where):
    """An id whose digits begin or end with something."""
    return lambda rest: digits + rest[len(digits) :] if where == "begin" else rest[: -len(digits)] + digits


@pytest.mark.parametrize(
    "told",
    [
        lambda row, rest: f"{row['target_object_id']:02x}{rest[2:]}",
        lambda row, rest: f"{rest[:-1]}{row['target_object_id'] % 16:x}",
        lambda row, rest: f"{rest[:5]}{row['start_object_id'] % 16:x}{rest[6:]}",
        lambda row, rest: f"{int(row['length_m']) % 256:02x}{rest[2:]}",
        lambda row, rest: f"{row['target_object_id'] * 2**32 + int(rest[:8], 16):012x}",
        lambda row, rest: f"{rest[:9]}{row['target_object_id'] * 17:03x}",
    ],
    ids=["target first", "target last", "start within", "length first", "counted by target", "target at the end"],
)
def test_ids_that_go_with_what_is_withheld(planted, told):
    """Another pipeline's salt is not known: what the ids tell is then found by chance's own measure."""
    other = definitions().model_copy(update={"split": Pipeline().split})
    assert check(planted, pipeline=other) == {}
    rename(planted, lambda row: f"{planted.scene}-{told(row, row['nav_id'][-12:])}")
    found = check(planted, pipeline=other)
    assert set(found) == {"telling_digits"}


def test_ids_that_anybody_could_compute(planted):
    def pair(row):
        return f"{row['start_object_id']}_{row['start_anchor_id']}__{row['target_object_id']}"

    def digest(text):
        return hashlib.blake2b(f"{planted.scene}/{text}".encode(), digest_size=6).hexdigest()

    keys = rename(planted, lambda row: f"{planted.scene}-{digest(pair(row))}")
    assert check(planted) == {"nav_id_guessed": keys}


def test_the_salt_names_the_release_and_stands_nowhere_in_it(planted):
    pipeline = definitions()
    key = key_of(pipeline.split.salt, pipeline.seed)
    row = planted.rows("routes/train")[0]
    pair = f"{row['start_object_id']}_{row['start_anchor_id']}__{row['target_object_id']}"
    assert row["nav_id"] == nav_id(planted.scene, pair, key)
    for path in planted.release.rglob("*"):
        assert path.is_dir() or pipeline.split.salt.encode() not in path.read_bytes()
