"""A plan under construction: random streams by part and place, sections, slots and what is dealt to them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.rng import generator, pick, rank
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.light import sun_at
from aerialdojo_gen.scenes.plans.text import plan_text
from aerialdojo_gen.scenes.worlds.kinds import Palette, SceneType
from aerialdojo_gen.scenes.worlds.paints import extents_m, repainted
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point, Pose
from aerialdojo_gen.scenes.worlds.world import World

STAGE = "vary"
T = TypeVar("T")
Entry = dict[str, Any]


class NoRoomError(Exception):
    """A draw makes no world; the message is the reason that is counted."""


@dataclass(frozen=True)
class Slot:
    """A place for one thing."""

    kind: str
    x: float
    y: float
    yaw_deg: float  # Where the front of what stands there looks
    room_m: tuple[float, float]  # Room along the front's direction, and across it
    on: float | str | None  # Height, or its name; the ground where None
    settle_m: float | None  # On a slope: see `Placement`


class Draft:
    """What a generator writes a world's plan with; x east, y north, metres, the origin in the middle."""

    def __init__(self, world: World, kind: SceneType, catalogue: Catalogue, trial: int = 0) -> None:
        self.world, self.kind, self.catalogue, self._trial = world, kind, catalogue, trial
        self._unknown_knobs()
        self.topology = self._one_of({name: t.held_out for name, t in kind.topologies.items()}, "topology")
        self.palette_name = self._one_of({name: p.held_out for name, p in kind.palettes.items()}, "palette")
        spans = kind.topologies[self.topology].size_m or kind.size_m
        self.width_m, self.depth_m = (self.whole(*span, "size", axis) for axis, span in zip("xy", spans, strict=True))
        self.half = self.width_m / 2, self.depth_m / 2
        self.site = Box(-self.half[0], -self.half[1], *self.half)
        self.head: Entry = self._light()
        self.lines: dict[str, Any] = {}
        self.areas: dict[str, Any] = {}
        self.floors: dict[str, float] = {}
        self.ground: Entry = {"material": self.material("ground")}
        self._entries: list[Entry] = []
        self._sections: dict[int, str] = {}
        self._title = ""
        self._slots: list[Slot] = []
        self._taken: list[BaseGeometry] = []
        self.landmarks: list[str] = []
        self.level_things = False  # Whether the ground is levelled under what stands on it

    # Random streams

    def rng(self, *key: object) -> np.random.Generator:
        """Make the stream of one part of the world, at one place: adding another part changes none of its draws."""
        world = self.world
        return generator(world.seed, STAGE, world.version, world.type, world.held_out, self._trial, *key)

    def number(self, low: float, high: float, *key: object) -> float:
        """Draw a number, to a tenth."""
        return round(float(self.rng(*key).uniform(low, high)), 1)

    def whole(self, low: float, high: float, *key: object) -> int:
        """Draw an integer from `low` to `high`, both included."""
        return int(self.rng(*key).integers(round(low), round(high) + 1))

    def chance(self, share: float, *key: object) -> bool:
        """Whether a thing happens that does in this share of the cases."""
        return bool(self.rng(*key).random() < share)

    def pick(self, options: Sequence[T], *key: object) -> T:
        """Draw one of several, all alike likely."""
        return pick(options, self.rng(*key))

    def shuffled(self, options: Iterable[T], *key: object) -> list[T]:
        """Return all of several in a drawn order."""
        given = list(options)
        return [given[k] for k in self.rng(*key).permutation(len(given))]

    def knob(self, name: str) -> float:
        """Value of a knob: the user's, or drawn."""
        knob = self.kind.knobs[name]
        if name in self.world.knobs:
            return self.world.knobs[name]
        draw = self.whole if knob.whole else self.number
        return draw(knob.low, knob.high, "knob", name)

    def _unknown_knobs(self) -> None:
        for name, value in self.world.knobs.items():
            if name not in self.kind.knobs:
                raise AssetError(f"--knob {name}: {unknown(f'{self.world.type} has no knob', name, self.kind.knobs)}")
            knob = self.kind.knobs[name]
            if not knob.low <= value <= knob.high or (knob.whole and value != int(value)):
                form = "an integer" if knob.whole else "a number"
                raise AssetError(f"--knob {name}={value:g}: must be {form} from {knob.low:g} to {knob.high:g}")

    def _one_of(self, held_out: Mapping[str, bool], key: str) -> str:
        return self.pick([name for name, held in held_out.items() if held == self.world.held_out], key)

    def _light(self) -> Entry:
        """Draw sky, light and horizon of the types that say where on earth they are."""
        head: Entry = {}
        if self.palette.sky:
            head["sky"] = self.pick(self.palette.sky, "sky")
        if self.kind.latitude_deg is not None:
            head["light"] = self._sun(self.kind.latitude_deg, self.pick(self.palette.weather, "weather"))
        if horizon := self.kind.topologies[self.topology].horizon:
            head["horizon"] = {"kind": horizon}
        return head

    def _sun(self, latitude_deg: tuple[float, float], weather: str) -> Entry:
        """Draw when and where it is; both hemispheres and all hours, so that light reveals no compass direction."""
        rng = self.rng("light")
        low, high = (0.06, 0.14) if weather == "dusk" else (0.3, 0.92)  # Sine of the sun's elevation
        light: Entry = {}
        for _ in range(400):
            side = 1 if rng.random() < 0.5 else -1
            latitude = side * int(rng.integers(round(latitude_deg[0]), round(latitude_deg[1]) + 1))
            date = f"{int(rng.integers(1, 13)):02d}-{int(rng.integers(1, 29)):02d}"
            hour = int(rng.integers(28, 69)) / 4
            light = {"latitude_deg": latitude, "date": date, "hour": hour, "weather": weather}
            if low <= sun_at(latitude, date, hour)[2] <= high:
                return light
        raise NoRoomError("no such light at this latitude")

    @property
    def palette(self) -> Palette:
        """The palette that was drawn."""
        return self.kind.palettes[self.palette_name]

    def material(self, role: str, *key: object) -> str:
        """Material of a role of the palette; of several one, drawn for the key."""
        choices = self.palette.materials[role]
        return choices if isinstance(choices, str) else self.pick(choices, "material", role, *key)

    # Entries

    def section(self, title: str) -> None:
        """Begin a section: the comment above its first entry."""
        self._title = title

    def add(self, entry: Entry) -> None:
        """Add an entry of a plan."""
        if self._title:
            self._sections[len(self._entries)] = self._title
            self._title = ""
        self._entries.append(entry)

    def paint(self, area: Any, material: str, **more: Any) -> None:
        """Paint an area."""
        self.add({"paint": area, "material": material, **more})

    def make(self, builder: str, **arguments: Any) -> None:
        """Call a builder of the kit."""
        self.add({"make": builder, **arguments})

    def step(self, builder: str, **arguments: Any) -> None:
        """Add a step to the ground."""
        self.ground.setdefault("steps", []).append({"make": builder, **arguments})

    def settle(self) -> None:
        """Settle things on ground that is not level, and level it under them."""
        self.head["placing"] = {"settle_m": 0.5, "margin_m": 0.4}
        self.level_things = True

    # Ground that is taken

    def take(self, area: BaseGeometry) -> None:
        """Take ground, so that `is_free` says so."""
        self._taken.append(area)

    def is_free(self, area: BaseGeometry) -> bool:
        """Whether an area lies on the site and on no ground that is taken."""
        return bool(self.site.shape().contains(area)) and not any(taken.intersects(area) for taken in self._taken)

    def has_room(self, x: float, y: float, radius_m: float) -> bool:
        """Whether a disc of ground is free."""
        return self.is_free(shapely.Point(x, y).buffer(radius_m))

    def take_disc(self, at: Point, radius_m: float) -> None:
        """Take a disc of ground."""
        self.take(shapely.Point(at).buffer(radius_m))

    def landmark(self, spots: Iterable[Pose], of: Iterable[str] | None = None) -> list[tuple[str, float, float]]:
        """Place the type's landmarks, or some `of` them, at the first free of some poses, each another category."""
        placed: list[tuple[str, float, float]] = []
        low, high = self.kind.n_landmarks
        wanted = self.whole(low, high, "n_landmarks")
        weights = self.kind.landmarks
        left = [what for what in (weights if of is None else of) if what not in self.landmarks]
        order = sorted(left, key=lambda c: -math.log(self.rng("landmark", c).random()) / weights[c])
        for x, y, yaw in spots:
            if not order or len(self.landmarks) >= wanted:
                break
            grounds = ((c, _box(x, y, *extents_m(self.catalogue, c), yaw, 0.5)) for c in order)
            what, ground = next((one for one in grounds if self.is_free(one[1])), ("", None))
            if ground is None:
                continue
            order.remove(what)
            self.take(ground)
            self.landmarks.append(what)
            thing = repainted(self.catalogue, what, (x, y, yaw), self.rng("landmark", what, "variant"))
            margin = {} if what in self.kind.overhanging else {"margin_m": 0.4}
            self.add({"place": [thing], "fit": "must", **margin, **self._levelled(None)})
            placed.append((what, x, y))
        return placed

    # Slots

    def slot(
        self, kind: str, x: float, y: float, yaw_deg: float = 0.0, room_m: tuple[float, float] = (2.4, 2.4),
        on: float | str | None = None, settle_m: float | None = None,
    ) -> None:  # fmt: skip
        """Offer a place for one thing; `kind` is one of the type's slots."""
        self._slots.append(Slot(kind, round(x, 2), round(y, 2), round(yaw_deg % 360.0, 1), room_m, on, settle_m))

    def slots_over(
        self, kind: str, box: Box, step_m: float, room_m: tuple[float, float], *key: object,
        yaw_deg: float | None = None, on: float | str | None = None, free_m: float = 0.0,
    ) -> None:  # fmt: skip
        """Offer slots over a box, evenly, on a disc of free ground; they look along one of the four sides, drawn."""
        for x, y in box.grid(step_m):
            if not free_m or self.has_room(x, y, free_m):
                yaw = self.pick(SIDES, *(key or (kind,)), x, y) if yaw_deg is None else yaw_deg
                self.slot(kind, x, y, yaw, room_m, on=on)

    def fill_slots(self) -> None:
        """Deal the type's things to the slots, and write them: what has no room in the built scene is left out."""
        used: Counter[tuple[str, str]] = Counter()
        rows: dict[tuple[str, float | str | None, float | None], list[Any]] = {}
        for kind in self.kind.slots:
            slots = [slot for slot in self._slots if slot.kind == kind]
            slots.sort(key=lambda s: rank(self.world.seed, STAGE, self._trial, kind, s.x, s.y, s.on))
            share = self.number(*self.kind.slots[kind].share, "share", kind) if slots else 0.0
            for slot in slots[: round(share * len(slots))]:
                what = self._draw_category(slot, used)
                if what is not None:
                    rng = self.rng("thing", kind, slot.x, slot.y, slot.on)
                    thing = repainted(self.catalogue, what, (slot.x, slot.y, slot.yaw_deg), rng)
                    rows.setdefault((kind, slot.on, slot.settle_m), []).append(thing)
        unknown_kinds = {slot.kind for slot in self._slots} - set(self.kind.slots)
        assert not unknown_kinds, f"{self.world.type}: no slots {unknown_kinds} in its table"
        for (kind, on, settle_m), things in rows.items():
            self.section(f"Things: {kind}{'' if on is None else f', on {on}'}")
            sure = self.kind.slots[kind].sure
            keys: Entry = {"fit": "as_is"} if sure else {"fit": "skip", "margin_m": 0.25}
            keys |= {} if on is None else {"on": on}
            keys |= {} if settle_m is None else {"settle_m": settle_m}
            things.sort(key=lambda thing: (thing[1], thing[2]) if isinstance(thing, list) else tuple(thing["at"]))
            self.add({"place": things, **keys, **self._levelled(on)})
        self._slots.clear()

    def _levelled(self, on: float | str | None) -> Entry:
        return {"level": True} if self.level_things and on is None else {}

    def available(self, kind: str, used: Counter[tuple[str, str]]) -> dict[str, float]:
        """Weights of what may still stand at slots of a kind: not too often, and not what is held out."""
        slots, held_out = self.kind.slots[kind], self.world.held_out
        return {
            what: weight for what, weight in slots.of.items()
            if used[kind, what] < slots.most and (held_out or what not in slots.held_out)
        }  # fmt: skip

    def _draw_category(self, slot: Slot, used: Counter[tuple[str, str]]) -> str | None:
        """Draw what stands at a slot; None where nothing that is left has room."""
        weights = {
            what: weight for what, weight in self.available(slot.kind, used).items()
            if all(e <= r for e, r in zip(extents_m(self.catalogue, what), slot.room_m, strict=True))
        }  # fmt: skip
        if not weights:
            return None
        rng = self.rng("slot", slot.kind, slot.x, slot.y, slot.on)
        what = list(weights)[int(rng.choice(len(weights), p=np.array([*weights.values()]) / sum(weights.values())))]
        used[slot.kind, what] += 1
        return what

    def add_life(self) -> None:
        """Set out the type's people and animals, where all else leaves room."""
        life = self.kind.life
        some: Entry = {
            kind: {c: n for c, (low, high) in of.items() if (n := self.whole(low, high, "life", c))}
            for kind, of in (("animals", life.animals), ("birds", life.birds))
        }
        some |= {"ground": life.ground, "decks": life.decks}
        self.section("People and animals")
        people = self.whole(*life.people, "life", "people")
        self.make("life", people=people, who=life.who, **{key: value for key, value in some.items() if value})

    # The plan

    def tables(self) -> Entry:
        """Return the plan."""
        low, high = self.kind.ceiling_m
        world = {
            "type": self.world.type, "seed": self.world.seed, "version": self.world.version, "draw": self._trial,
            "topology": self.topology, "palette": self.palette_name, "held_out": self.world.held_out,
            "knobs": {name: self.knob(name) for name in self.kind.knobs},
        }  # fmt: skip
        turn = {"turn_deg": self.pick((0, 90, 180, 270), "turn")} if self.kind.turns else {}
        return {
            "plan": 1, "seed": rank(self.world.seed, STAGE, self._trial) % 2**31,
            "size_m": [self.width_m, self.depth_m], "ceiling_m": self.whole(low, high, "ceiling"), **turn,
            **self.head, **({"designs": "held_out"} if self.world.held_out else {}),
            "world": world, "floor_m": self.floors, "lines": self.lines, "areas": self.areas,
            "ground": self.ground, "site": self._entries,
        }  # fmt: skip

    def text(self) -> str:
        """Return the plan as TOML."""
        name, about = self.world.name, self.kind.topologies[self.topology].about
        return plan_text(self.tables(), f"{name}: {about}", self._sections)


def _box(x: float, y: float, along: float, across: float, yaw_deg: float, margin_m: float) -> BaseGeometry:
    half_u, half_v = along / 2 + margin_m, across / 2 + margin_m
    box = shapely.affinity.rotate(shapely.box(-half_u, -half_v, half_u, half_v), yaw_deg, origin=(0, 0))
    return shapely.affinity.translate(box, x, y)
