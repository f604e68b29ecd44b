"""The release's dataset card: a README.md with the YAML that `datasets.load_dataset` reads, made from the data."""

from __future__ import annotations

import re
from typing import Any

import jinja2
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.constants import DETOUR
from aerialdojo_gen.base.paper_figures import inventory
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.dataset.contents import CARD, TABLES, check_release, counts, meaning, sizes, unit, write_document
from aerialdojo_gen.dataset.croissant import CITE_AS
from aerialdojo_gen.dataset.provenance import made_of_scenes, makers
from aerialdojo_gen.dataset.stats.comparison import Comparison, Listing
from aerialdojo_gen.dataset.stats.measures import difficulty_tables, goal_tables, read_goals, read_tasks
from aerialdojo_gen.dataset.stats.tables import Made
from aerialdojo_gen.dataset.stats.variety import read_variety, variety_table
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, Where, open_root

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


def _column_type(field: pa.Field) -> str:
    kind = str(field.type).replace("element: ", "").replace(" not null", "").replace("double", "float64")
    return kind + (", or null" if field.nullable else "")


def _hf_type(kind: pa.DataType, indent: int = 4) -> str:
    """Type of a column in the words of `datasets`, a key of YAML and its value; bytes become pictures."""
    if pa.types.is_list(kind) and pa.types.is_struct(kind.value_type):
        start = "\n" + " " * indent
        fields = (f"{start}- name: {f.name}{start}  {_hf_type(f.type, indent + 2)}" for f in kind.value_type)
        return "list:" + "".join(fields)
    if pa.types.is_list(kind):
        return f"list: {str(kind.value_type).replace('double', 'float64')}"
    return f"dtype: {'image' if pa.types.is_binary(kind) else str(kind).replace('double', 'float64')}"


def _scene_rows(root: DataRoot, made: list[Made]) -> list[dict[str, Any]]:
    return [
        store.read_scene(root, "release/scenes", m.scene).to_pylist()[0]
        | {"landmarks": m.landmarks, "objects": m.objects, "tasks": m.instances, "km": m.path_m / 1000}
        | {"paper_km": m.paper_scene.path_m / 1000 if m.paper_scene else None}
        for m in made
    ]


def _attributions(scenes: list[dict[str, Any]]) -> dict[str, list[str]]:
    """Scenes by whose data they are made of; those of this program's own are left out."""
    found: dict[str, list[str]] = {}
    for row in scenes:
        if row["attribution"]:
            found.setdefault(row["attribution"], []).append(row["scene"])
    return found


def _by_setting(made: list[Made], splits: list[str]) -> dict[str, dict[str, int]]:
    total = {split: dict.fromkeys(schemas.SETTINGS, 0) for split in splits}
    for m in made:
        for (subset, setting), n in m.tasks.items():
            total[f"{store.partition(m.scene)}_{subset}"][setting] += 2 * n
    return total


def _example(root: DataRoot, scenes: list[str]) -> dict[str, Any] | None:
    """Return the first semantic task of the shortest setting there is."""
    parts = (store.read_scene(root, f"tasks/{subset}", scene) for scene in scenes for subset in ("train", "test"))
    found = (tasks.filter(pc.equal(tasks["modality"], "semantic")).slice(0, 1).to_pylist() for tasks in parts)
    return next((rows[0] for rows in found if rows), None)


def _of_paper(made: Made) -> bool:
    """Whether a scene has the paper's numbers of everything."""
    paper_scene = made.paper_scene
    return paper_scene is not None and (
        (made.landmarks, made.objects) == (paper_scene.landmarks, paper_scene.objects)
        and all(made.of(setting) == paper_scene.tasks[setting] for setting in schemas.SETTINGS)
    )


def _difficulty(tasks: pd.DataFrame) -> dict[str, str]:
    """Tables of difficulty and splits as Markdown, without their headings; none where the release lacks them."""
    made = dict(zip(("setting", "scene", "seen", "held_out"), difficulty_tables(tasks), strict=False))
    return {name: _rows(table) for name, table in made.items()} if "held_out" in made else {}


def _rows(table: Comparison | Listing) -> str:
    """Give a table as Markdown without its heading."""
    return "\n".join(table.markdown()[2:]).rstrip()


def render_card(data: Where) -> str:
    """Write the card's text from what the release holds."""
    root = open_root(data)
    names = check_release(root)
    found = counts(root, names)
    made = made_of_scenes(root, names)
    names = [m.scene for m in made]
    objects = [store.read_scene(root, "release/objects", name, ["category"]) for name in names]
    by_setting = _by_setting(made, list(found["tasks"]))
    n_tasks = sum(found["tasks"].values())
    scenes = _scene_rows(root, made)
    tasks, known = read_tasks(root, names), makers(root)
    own = set(names) == set(inventory())
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("aerialdojo_gen.dataset"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 (Markdown, from our own tables)
    )
    return environment.get_template("card.md.j2").render(
        version=__version__,
        tables=TABLES,
        found=found,
        sizes=sizes(root, names),
        scenes=scenes,
        n_tasks=n_tasks,
        n_routes=sum(found["routes"].values()),
        n_types=len({row["scene_type"] for row in scenes}),
        n_categories=len(pc.unique(pa.concat_tables(objects).column("category"))),
        km=sum(m.path_m for m in made) / 1000,
        settings=schemas.SETTINGS,
        by_setting=by_setting,
        totals={s: sum(row[s] for row in by_setting.values()) for s in schemas.SETTINGS},
        size_category=next((name for most, name in _SIZES if n_tasks < most), "1M<n<10M"),
        first_split=next((split for split, n in found["tasks"].items() if n), "id_train"),
        example=_example(root, names),
        actions=schemas.ACTION_NAMES,
        of_paper=all(map(_of_paper, made)) and own,
        own_scenes=own,
        attributions=_attributions(scenes),
        made_by=sorted({maker.name for maker in known.values()} - {""}),
        prefers_harder=any(maker.prefer_harder for maker in known.values()),
        tables_of=_difficulty(tasks),
        worth={table.title: _rows(table) for table in goal_tables(read_goals(root, names), tasks)},
        variety=_rows(variety_table(measured)) if (measured := read_variety(root, names)) else "",
        least_detour=float(np.min(tasks["plan_detour"].to_numpy())) if len(tasks) else None,
        most_visible=float(np.max(tasks["target_visible_at_start"].to_numpy())) if len(tasks) else None,
        detour=DETOUR,
        citation=re.sub(", (?=title|author|year)", ",\n  ", CITE_AS),
        hf_type=_hf_type,
        column_type=_column_type,
        meaning=meaning,
        unit=unit,
    )


def write_card(data: Where) -> None:
    """Write ``release/README.md`` from what the release holds."""
    write_document(data, CARD, render_card(data))
