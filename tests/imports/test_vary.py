"""`vary` writes worlds that run through the stages, and makes none twice."""

import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.dataset.build import run_pipeline
from aerialdojo_gen.imports.worlds import VaryOptions, vary
from aerialdojo_gen.store.root import open_root

WORLD = ["U_ParkingLot"], range(7, 8)


def files_of(data: Path) -> dict[str, bytes]:
    return {str(p.relative_to(data)): p.read_bytes() for p in data.rglob("*") if p.is_file() and p.name != ".lock"}


@pytest.mark.pipeline
def test_a_world_runs_through_the_stages_by_its_mesh_until_its_plan_is_edited(tmp_path: Path) -> None:
    """Worlds to train on, from seed 1000 on, do so in `tests/learning/test_trajectories.py`."""
    out, options = tmp_path / "worlds", VaryOptions({"occupancy": 0.4}, n_objects=2)
    (one,) = vary(["U_Parking*"], WORLD[1], out, options)
    assert one.made
    data, name = out / "data", "U_ParkingLot-7"
    mesh, shard, plan = data / f"meshes/{name}.glb", data / f"scenes/{name}/part-00000.parquet", out / "scenes"

    def computed(where: Path = data) -> int:
        (built,) = run_pipeline(out / "pipeline.toml", data=where, stages=["build-scenes"], workers=1)
        return built.computed

    handed_over = files_of(data)
    assert set(handed_over) == {str(file.relative_to(data)) for file in (mesh, shard)}
    assert computed(tmp_path / "other") == 1
    assert files_of(tmp_path / "other") == handed_over

    before = {p: p.stat().st_mtime_ns for p in out.rglob("*.*ml")}
    (again,) = vary(*WORLD, out, options)
    assert not again.made
    assert {p: p.stat().st_mtime_ns for p in out.rglob("*.*ml")} == before
    with pytest.raises(UsageError, match="occupancy"):
        vary(*WORLD, out, VaryOptions({"occupancy": 0.5}))

    built, *others = run_pipeline(out / "pipeline.toml", data=data, stages=["split"], workers=1)
    assert (built.stage, built.computed, built.shards) == ("build-scenes", 0, 1)
    assert all(stage.computed for stage in others)
    tables = [pq.read_table(p) for p in (data / "release/tasks").rglob(f"part-{name}.parquet")]
    assert {s for t in tables for s in t.column("subset").to_pylist()} == {"test"}

    text = (plan / f"{name}.toml").read_text()
    (plan / f"{name}.toml").write_text(text.replace("\nceiling_m = ", "\nceiling_m = 1", 1))
    assert computed() == 1
    assert pq.read_table(shard).column("ceiling_m").to_pylist()[0] > 100

    shutil.rmtree(plan)
    with open_root(data).lock(), pytest.raises(StoreError, match="another run is writing"):
        vary(*WORLD, out)
    assert list(plan.iterdir()) == []


@pytest.mark.parametrize("seeds", [range(0), range(-1, 1)])
def test_seeds_that_are_none_are_refused(seeds: range, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--seeds"):
        vary(["U_ParkingLot"], seeds, tmp_path)
    assert list(tmp_path.iterdir()) == []
