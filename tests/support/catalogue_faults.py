"""Verification of the catalogue's statements about its categories on the meshes that it builds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product
from types import MappingProxyType

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.appearances import Body
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.model import Instance

MIN_LOOKS = 3
# Descriptions need a choice: with fewer phrases true of an instance, all of its kind would read alike.
MIN_TRUE_PHRASES = 2


def catalogue_faults(
    catalogue: Catalogue, categories: Iterable[str] | None = None, every: bool = True,
    things: Mapping[tuple[str, str], Instance] = MappingProxyType({}),
) -> list[str]:  # fmt: skip
    """Build the target categories, but for `things` by variant and design; list the false statements about them.

    Every variant in every design; or every variant in the first design, and the first variant in every design.
    """
    faults = []
    for name in catalogue.targets if categories is None else categories:
        prop = catalogue[name]
        if not prop.front:
            faults.append(f"{prop.source}: front is missing")
            continue
        if len(prop.looks) < MIN_LOOKS:
            faults.append(f"{prop.source}: {len(prop.looks)} looks, {MIN_LOOKS} are the least")
        why: dict[str, list[str]] = {look.phrase: [] for look in prop.looks}
        for variant, design in product(prop.variants, prop.designs):
            if not every and variant is not prop.variants[0] and design is not prop.designs[0]:
                continue
            made = f"variant {variant.name!r}" + (f", design {design.name!r}" if design.name != "plain" else "")
            rng = generator(0, "check", name, variant.name)
            thing = things.get((variant.name, design.name)) or catalogue.instantiate(
                name, "thing", rng, variant=variant.name, design=design.name
            )
            assert thing.anatomy is not None
            for tell in thing.anatomy.identifying_parts:
                if not len(thing.faces_of(tell)):
                    faults.append(f"{prop.source} {made}: tells: it has no {tell}")
            body = Body(thing, catalogue.materials)
            wrong = {look.phrase: body.false_claims(look) for look in prop.looks}
            true = sum(not w for w in wrong.values())
            if true < min(MIN_TRUE_PHRASES, len(prop.looks)):
                faults.append(f"{prop.source} {made}: {true} looks are true of it: {_message(wrong)}")
            for say, claims in wrong.items():
                why[say].append(f"{variant.name}: {', '.join(claims)}" if claims else "")
        faults += [
            f"{prop.source}: {say!r} is true of no variant ({'; '.join(dict.fromkeys(claims))})"
            for say, claims in why.items()
            if every and all(claims)
        ]
    return faults


def _message(wrong: dict[str, list[str]]) -> str:
    return "; ".join(f"{say!r}: {', '.join(claims)}" for say, claims in wrong.items() if claims)
