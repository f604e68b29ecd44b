"""The published figures: measured on a release, kept in `docs/facts.json`, written into the pages.

    make facts                # measures data/, writes docs/facts.json and the pages
    make facts DATA=DIR

In a page, `<!-- fact release.tasks_mb -->9.4` is the fact's value, with as many decimals as the page has. The tables
of `make evaluate` go between `<!-- table evaluate -->` and `<!-- end -->`, if the data directory has its runs.
Every group of facts has the commit and machine of its measurement; a group that is not measured keeps its values.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from aerialdojo_gen.base.constants import DETOUR, SETTINGS, SUBSETS, SUCCESS_RADIUS_M
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURNS

ROOT = Path(__file__).resolve().parents[1]
FACTS = ROOT / "docs/facts.json"
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md"))]
TABLES = ("tasks", "routes", "viewpoints", "anchors", "scenes", "landmarks", "objects")
AGENTS = ("oracle", "stop", "constant", "random", "explorer")
_FACT = re.compile(r"(<!-- fact (\w+)\.(\w+) -->)([0-9a-f]{7,}|[\d,]*\d(?:\.\d+)?)")
_TABLE = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def sizes(release: Path) -> dict[str, float]:
    """Bytes, rows and row groups of the release's tables; the pictures apart from the objects."""
    facts: dict[str, float] = {"files": 0}
    for table in TABLES:
        rows = groups = total = footers = pictures = 0
        for path in sorted((release / table).rglob("*.parquet")):
            footer = pq.read_metadata(path)
            facts["files"] += 1
            rows, groups = rows + footer.num_rows, groups + footer.num_row_groups
            total, footers = total + path.stat().st_size, footers + footer.serialized_size
            for group in range(footer.num_row_groups):
                columns = (footer.row_group(group).column(i) for i in range(footer.num_columns))
                pictures += sum(c.total_compressed_size for c in columns if c.path_in_schema == "reference_image")
        facts |= {f"{table}_rows": rows, f"{table}_groups": groups}
        facts |= {f"{table}_mb": (total - pictures) / 1e6, f"{table}_footers_mb": footers / 1e6}
        facts |= {"pictures_mb": pictures / 1e6} if pictures else {}
    return facts | {"release_mb": sum(facts[f"{table}_mb"] for table in TABLES)}


def share(mask: Any) -> float:
    """The percentage of rows for which it is true."""
    return 100 * float(np.mean(np.asarray(mask, float)))


def frame(folder: Path, *columns: str) -> pd.DataFrame:
    """Columns of a table; `split` is the folder of a file."""
    folders = ["split"] if "split" in columns else None
    return ds.dataset(folder, format="parquet", partitioning=folders).to_table([*columns]).to_pandas()


def of_routes(release: Path) -> dict[str, float]:
    """What the reference routes are like."""
    routes = frame(
        release / "routes", "setting", "length_m", "min_clearance_m", "plan_detour", "straight_line_free", "action",
        "target_visible_at_start", "split",
    )  # fmt: skip
    poses, detour = routes["action"].str.len(), routes["plan_detour"]
    quartiles = routes["min_clearance_m"].quantile([0.25, 0.5, 0.75])
    facts = {
        "routes_km": routes["length_m"].sum() / 1000,
        "poses": int(poses.sum()),
        "poses_id_train": int(poses[routes["split"] == "id_train"].sum()),
        "poses_train": int(poses[routes["split"].str.endswith("_train")].sum()),
        "detour_median": float(detour.median()),
        "detour_p90": float(detour.quantile(0.9)),
        **dict(zip(("clearance_q1_m", "clearance_median_m", "clearance_q3_m"), quartiles, strict=True)),
    }
    for name in ("all", *SETTINGS):
        some = routes if name == "all" else routes[routes["setting"] == name]
        if some.empty:
            continue
        action = np.concatenate(some["action"].to_list())
        level = np.hypot(DISPLACEMENTS[action, 0], DISPLACEMENTS[action, 1]).sum()
        facts |= {
            f"easy_detour_{name}_percent": share(some["plan_detour"] < DETOUR),
            f"straight_free_{name}_percent": share(some["straight_line_free"]),
            f"in_view_{name}_percent": share(some["target_visible_at_start"] > 0),
            f"sideways_{name}_percent": 100 * float(np.abs(DISPLACEMENTS[action, 1]).sum() / level),
            f"turns_{name}_percent": share(TURNS[action] != 0),
        }
    return facts


def of_tasks(release: Path) -> dict[str, float]:
    """What the splits leave unseen, what a language model would be asked, and goals with another viewpoint."""
    seen = [f"{what}_seen_in_train" for what in ("target", "start", "pair")]
    tasks = frame(release / "tasks", "nav_id", "split", "setting", "action_budget", "modality", *seen)
    goal = ["goal_x_m", "goal_y_m", "goal_z_m"]
    routes = frame(release / "routes", "nav_id", "n_actions", "scene", "target_object_id", *goal)
    facts: dict[str, float] = {}
    one_each = tasks[tasks["modality"] == "semantic"]
    tests = [subset for subset in SUBSETS if subset.endswith("_test")]
    for subset in tests:
        mine = one_each[one_each["split"] == subset]
        facts |= {
            f"{subset}_tasks": len(mine),
            f"{subset}_unseen_targets": int((~mine["target_seen_in_train"]).sum()),
            f"{subset}_unseen_targets_percent": share(~mine["target_seen_in_train"]),
            f"{subset}_unseen_starts_percent": share(~mine["start_seen_in_train"]),
            f"{subset}_seen_pairs_percent": share(mine["pair_seen_in_train"]),
        }
    asked = tasks[tasks["split"].isin(tests) & (tasks["setting"] == "base")]
    # Without the Approach, which is no action of an agent.
    actions = asked.merge(routes[["nav_id", "n_actions"]], on="nav_id")["n_actions"] - 1
    facts |= {"base_test_episodes": len(asked), "base_test_reference_actions": int(actions.sum())}
    facts["base_test_budget"] = int(asked["action_budget"].sum())
    anchors = frame(release / "anchors", "scene", "object_id", "x_m", "y_m", "z_m")
    both = routes.merge(anchors, left_on=["scene", "target_object_id"], right_on=["scene", "object_id"])
    offset = both[["x_m", "y_m", "z_m"]].to_numpy() - both[goal].to_numpy()
    far = both.loc[np.linalg.norm(offset, axis=1) > SUCCESS_RADIUS_M, "nav_id"]
    return facts | {"other_viewpoint_percent": share(routes["nav_id"].isin(far))}


def of_plans(data: Path) -> dict[str, float]:
    """By how many percent routes are longer than predicted: median, 10th and 90th percentile."""
    plans = frame(data / "plans", "predicted_length_m", "length_m", "outcome").query("outcome == 'SOLVED'")
    excess = 100 * (plans["length_m"] / plans["predicted_length_m"] - 1)
    p10, median, p90 = (float(value) for value in np.nanquantile(excess, (0.1, 0.5, 0.9)))
    return {"longer_p10_percent": p10, "longer_median_percent": median, "longer_p90_percent": p90}


def evaluate_tables(data: Path) -> str:
    """Print the tables of `make evaluate` from its runs, as Markdown; empty where there are none."""
    runs = [f"tables-{agent}" for agent in AGENTS]
    if not all((data / "episodes" / run).is_dir() for run in runs):
        return ""
    tables = [word for table in ("overall", "results", "partition") for word in ("--table", table)]
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "report", *runs, *tables, "--data", data]
    command += ["--format", "markdown"]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.strip() + "\n"


def measured_on() -> dict[str, str]:
    """The commit and the machine."""
    told = subprocess.run(["git", "rev-parse", "--short=7", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    models = re.findall(r"^model name\s*: (.*)", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    return {"commit": told.stdout.strip(), "machine": f"{models[0] if models else 'unknown'}, {os.cpu_count()} cores"}


def show(value: float | str, like: str) -> str:
    """A value as the page writes it: as many decimals as `like` has."""
    if isinstance(value, str):
        return value
    return f"{value:,.{len(like.partition('.')[2])}f}"


def filled(text: str, facts: dict[str, Any]) -> str:
    """A page with the figures and tables of the facts; a marker of an unknown fact is a KeyError."""

    def fact(at: re.Match[str]) -> str:
        group = facts[at[2]]
        return at[1] + show(group[at[3]] if at[3] in group else group["facts"][at[3]], at[4])

    text = _FACT.sub(fact, text)
    return _TABLE.sub(lambda at: f"{at[1]}{facts[at[2]]['table']}{at[3]}", text)


def main(data: Path) -> None:
    """Measure, and write the facts and the pages."""
    release = data / "release"
    here = measured_on()
    facts = json.loads(FACTS.read_text(encoding="utf-8"))
    facts["release"] = {**here, "facts": sizes(release) | of_routes(release) | of_tasks(release)}
    if (data / "plans").is_dir():
        facts["plans"] = {**here, "facts": of_plans(data)}
    if table := evaluate_tables(data):
        facts["evaluate"] = {**here, "table": "Measured at {commit} ({machine}).\n\n".format(**here) + table}
    texts = {page: filled(page.read_text(encoding="utf-8"), facts) for page in PAGES}
    FACTS.write_text(json.dumps(rounded(facts), indent=1) + "\n", encoding="utf-8")
    for page, text in texts.items():
        page.write_text(text, encoding="utf-8")


def rounded(value: Any) -> Any:
    """Six significant digits: the file's figures are to be read, too."""
    if isinstance(value, dict):
        return {key: rounded(one) for key, one in value.items()}
    return float(f"{value:.6g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "data"))
