"""`vary` writes worlds that run through the stages, and makes none twice."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.dataset.build import run_pipeline
from aerialdojo_gen.imports.worlds import VaryOptions, vary


@pytest.mark.pipeline
def test_a_world_runs_through_the_stages_and_tests_by_its_seed(tmp_path: Path) -> None:
    """Worlds to train on, from seed 1000 on, do so in `tests/learning/test_several_places.py`."""
    out, options = tmp_path / "worlds", VaryOptions({"occupancy": 0.4}, n_objects=3)
    (one,) = vary(["U_Parking*"], range(7, 8), out, options)
    assert one.made
    before = {p: p.stat().st_mtime_ns for p in out.rglob("*.*ml")}
    (again,) = vary(["U_ParkingLot"], range(7, 8), out, options)
    assert not again.made
    assert {p: p.stat().st_mtime_ns for p in out.rglob("*.*ml")} == before
    with pytest.raises(UsageError, match="occupancy"):
        vary(["U_ParkingLot"], range(7, 8), out, VaryOptions({"occupancy": 0.5}))
    run_pipeline(out / "pipeline.toml", data=out / "data", workers=1)
    tables = [pq.read_table(p) for p in (out / "data/release/tasks").rglob("part-U_ParkingLot-7.parquet")]
    assert {s for t in tables for s in t.column("subset").to_pylist()} == {"test"}


@pytest.mark.parametrize("seeds", [range(0), range(-1, 1)])
def test_seeds_that_are_none_are_refused(seeds: range, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--seeds"):
        vary(["U_ParkingLot"], seeds, tmp_path)
    assert list(tmp_path.iterdir()) == []
