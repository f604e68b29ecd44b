"""Worlds: sound scenes from seeds and knobs, the same every time, and streams that do not depend on one another."""

import ast
import contextlib
import hashlib
import os
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.layout_checks import ASSETS, catalogue, drawn

import aerialdojo_gen.scenes.worlds
from aerialdojo_gen.annotations.phrases import phrases_of_value
from aerialdojo_gen.annotations.vocabulary import SHADES
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.dataset.validate.meshes import _Air
from aerialdojo_gen.scenes.checks import faults
from aerialdojo_gen.scenes.colours import colour_name
from aerialdojo_gen.scenes.light import sun_at
from aerialdojo_gen.scenes.materials import parse_colour
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.kinds import load_type, type_names
from aerialdojo_gen.scenes.worlds.make import MAX_BYTES, MAX_DRAWS, generator_of, make_world
from aerialdojo_gen.scenes.worlds.paints import PAINTS, paintable
from aerialdojo_gen.scenes.worlds.world import World, world_of

TYPES = type_names(ASSETS)
# SHA-256 of the plans of worlds, by name: tests/bench/bench_worlds.py --digests.
DIGESTS = {
    name: digest
    for digest, name in map(str.split, (ASSETS.parent / "tests/golden/worlds.sha256").read_text().splitlines())
}

DAY = int(os.environ["SAMPLE_SEED"])
DRAWN = int(generator(DAY, "world").integers(2**31))


def draft_of(world: World) -> Draft | None:
    """The first draw of a world; None where it has no room."""
    draft = Draft(world, load_type(world.type, ASSETS, catalogue()), catalogue())
    try:
        generator_of(world.type)(draft)
    except NoRoomError:
        return None
    return draft


@pytest.mark.parametrize("kind", drawn(TYPES, 7))
def test_a_draw_of_a_world_has_its_digest(kind: str) -> None:
    world = World(kind, 1000)
    for trial in range(MAX_DRAWS):
        draft = Draft(world, load_type(kind, ASSETS, catalogue()), catalogue(), trial)
        with contextlib.suppress(NoRoomError):
            generator_of(kind)(draft)
            draft.add_life()
            if hashlib.sha256(draft.text().encode()).hexdigest() == DIGESTS[world.name]:
                return
    pytest.fail(f"no draw of {world.name} has its digest")


@pytest.mark.parametrize("kind", drawn(TYPES, 1))
@pytest.mark.parametrize(("seed", "held_out"), [
    pytest.param(*one, marks=[] if k == DAY % 3 else pytest.mark.nightly)
    for k, one in enumerate([(1000, False), (DRAWN, True), (DRAWN, False)])
])  # fmt: skip
def test_a_world_is_sound_of_its_side_and_as_on_the_day_of_its_digest(kind: str, seed: int, held_out: bool) -> None:
    made = make_world(World(kind, seed, held_out=held_out), ASSETS, catalogue())
    if made.world.name in DIGESTS:
        assert hashlib.sha256(made.text.encode()).hexdigest() == DIGESTS[made.world.name]
    assert len(made.text) <= MAX_BYTES
    assert list(faults(made.scene, catalogue())) == []
    table = load_type(kind, ASSETS, catalogue())
    world = tomllib.loads(made.text)["world"]
    assert table.topologies[world["topology"]].held_out == table.palettes[world["palette"]].held_out == held_out
    withheld = {what for slots in table.slots.values() for what in slots.held_out}
    assert held_out or withheld.isdisjoint(i.category for i in made.scene.instances), made.world.name


@pytest.mark.nightly
@pytest.mark.parametrize("name", sorted(DIGESTS)[::7])
def test_a_world_has_its_digest(name: str) -> None:
    made = make_world(world_of(name), ASSETS, catalogue())
    assert hashlib.sha256(made.text.encode()).hexdigest() == DIGESTS[name]


def test_digests_are_of_all_types_and_sides() -> None:
    sides = Counter((world.type, world.side) for world in map(world_of, DIGESTS))
    wanted = {"train": 48, "validation": 10, "test": 10}
    assert sides == {(kind, side): n for kind in TYPES for side, n in wanted.items()}


def test_every_type_of_the_scenes_has_a_generator_and_suns_on_all_sides() -> None:
    assert {path.stem.rsplit("_", 1)[0] for path in (ASSETS / "scenes").glob("*.toml")} == set(TYPES)
    for kind in ("N_Desert", "D_Flood"):
        table = load_type(kind, ASSETS, catalogue())
        lights = [Draft(World(kind, seed), table, catalogue()).head["light"] for seed in range(60)]
        suns = [sun_at(light["latitude_deg"], light["date"], light["hour"]) for light in lights]
        assert {(x > 0, y > 0) for x, y, _ in suns} == {(a, b) for a in (True, False) for b in (True, False)}
        assert {light["weather"] for light in lights} >= {"clear", "overcast"} & {
            weather for palette in table.palettes.values() if not palette.held_out for weather in palette.weather
        }
        assert all(z > 0.05 for *_, z in suns)


def test_seeds_give_all_topologies() -> None:
    for kind in TYPES:
        table = load_type(kind, ASSETS, catalogue())
        drafts = [Draft(World(kind, seed), table, catalogue()) for seed in range(1000, 1040)]
        assert {d.topology for d in drafts} == {name for name, t in table.topologies.items() if not t.held_out}, kind


@pytest.mark.parametrize("kind", drawn(TYPES, 1))
def test_seeds_give_other_worlds_with_room(kind: str) -> None:
    drafts = [d for d in (draft_of(World(kind, seed)) for seed in range(1000, 1012)) if d is not None]
    assert len(drafts) >= 10
    assert len({d.text().split("\n", 1)[1] for d in drafts}) == len(drafts)


def test_a_knob_changes_its_part_alone() -> None:
    kind = "U_ParkingLot"
    few, many = (draft_of(World(kind, 1002, {"occupancy": share})) for share in (0.4, 0.8))
    assert few is not None
    assert many is not None
    assert [entry for entry in few.tables()["site"] if "occupancy" in entry]
    for one, other in zip(few.tables()["site"], many.tables()["site"], strict=True):
        assert {**one, "occupancy": 0} == {**other, "occupancy": 0}


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("U_ParkingLot", {"knobs": {"storys": 2.0}}, "storeys"),
        ("U_ParkingLot", {"knobs": {"storeys": 2.5}}, "an integer"),
        ("U_ParkingLot", {"knobs": {"storeys": 99.0}}, "from 1 to 4"),
        ("U_ParkingLot", {"version": 7}, "version 7"),
        ("U_ParkingLod", {}, "U_ParkingLot"),
    ],
)
def test_what_no_world_is_made_from_is_refused_in_a_line(kind: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(AssetError, match=message):
        make_world(World(kind, 1000, **options), ASSETS, catalogue())


@given(st.sampled_from(TYPES), st.integers(0, 2**31 - 1), st.booleans())
def test_a_name_says_what_a_world_is_made_from(kind: str, seed: int, held_out: bool) -> None:
    world = World(kind, seed, held_out=held_out)
    assert world_of(world.name) == world
    assert world.side == ("test" if seed < 200 else "validation" if seed < 1000 else "train")


def test_a_footbridge_rests_on_both_banks_though_one_is_lower() -> None:
    scene = make_world(World("N_Forest", 1000), ASSETS, catalogue()).scene
    (k,) = [k for k, thing in enumerate(scene.instances) if thing.category == "footbridge"]
    assert _Air(scene).under(k, scene.instances[k]) == 0.0
    assert "plinth_footbridge_000" in {thing.node for thing in scene.instances}


def test_paints_are_the_colours_that_they_are_called() -> None:
    for word, shades in PAINTS.items():
        for shade in shades:
            assert colour_name(parse_colour(shade)) in SHADES[word], (word, shade)
        # A "mailbox with a navy" is none.
        assert all(wording.startswith("+") for wording in phrases_of_value("colour", word, "mailbox")), word
    assert paintable(catalogue(), "sedan") == ("body", ("red", "silver", "blue", "black", "white"))


def test_generators_draw_from_keyed_streams_alone() -> None:
    folder = Path(aerialdojo_gen.scenes.worlds.__file__).parent
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not {"random", "time", "uuid", "datetime", "secrets"} & {n.partition(".")[0] for n in names}, path
            if isinstance(node, ast.Attribute) and node.attr in ("default_rng", "seed"):
                assert not (isinstance(node.value, ast.Attribute) and node.value.attr == "random"), path
