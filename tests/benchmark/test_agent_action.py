"""The references as agents can fly them: flown by the oracle, and checked in a release."""

from __future__ import annotations

import dataclasses

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.extended import set_agent_actions, set_columns, with_column
from support.planting import Planted, definitions

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents import load_agent
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.dataset.validate import oracle
from aerialdojo_gen.dataset.validate.parts import read_tables, release_of
from aerialdojo_gen.dataset.validate.rows import Rows, SceneData
from aerialdojo_gen.store.schemas import APPROACH, STOP
from aerialdojo_gen.store.schemas.columns import list_of

SEMANTIC = Selection(scenes=("U_Courtyard_0",), modalities=("semantic",))
AS_AGENT = Evaluation("r", "oracle", {"actions": "agent_action"}, SEMANTIC)


def test_flown_for_all_routes_they_all_succeed(planted: Planted) -> None:
    set_agent_actions(planted)
    outcome = evaluate(planted.data, AS_AGENT)
    rows = read_run(planted.data, "r").to_pandas()
    assert outcome.finished == len(rows) == len(planted.rows("routes/train")) + len(planted.rows("routes/test"))
    assert rows.success.all()
    assert not rows.collision.any()
    assert (rows.final_distance_m <= 1.0).all()
    steps = read_run(planted.data, "r", "steps").to_pandas()
    assert steps.action.max() < APPROACH
    assert (steps.groupby("task_id").action.last() == STOP).all()


def test_it_flies_that_list_and_no_other(planted: Planted) -> None:
    for side in ("train", "test"):
        lists = [[14, STOP]] * len(planted.rows(f"routes/{side}"))
        set_columns(planted, f"routes/{side}", agent_action=pa.array(lists, list_of(pa.int8())))
    evaluate(planted.data, AS_AGENT)
    steps = read_run(planted.data, "r", "steps").to_pandas()
    assert steps.groupby("task_id").action.apply(list).map(tuple).unique().tolist() == [(14, STOP)]


def test_a_release_without_them_says_so_in_one_line(planted: Planted) -> None:
    for side in ("train", "test"):
        whole = pq.read_table(planted.path(f"routes/{side}"), partitioning=None)
        kept = [name for name in whole.column_names if name != "agent_action"]
        planted.write_table(f"routes/{side}", whole.select(kept))
    with pytest.raises(StoreError, match=r"the routes of U_Courtyard_0 in .* have no agent_action") as error:
        evaluate(planted.data, AS_AGENT)
    assert "\n" not in str(error.value)
    with pytest.raises(UsageError, match="routes have the lists action and agent_action, not 'actions'"):
        load_agent("oracle", actions="actions")


@pytest.fixture
def checked(planted: Planted) -> SceneData:
    release = release_of(planted.data)
    return SceneData(planted.scene, release, definitions(), read_tables(release, planted.scene)[0])


def told(data: SceneData, change: dict[int, list[int]] | None = None) -> Rows:
    """The routes with their actions as an agent's, some of them changed."""
    routes = data["routes"]
    lists = [[a for a in actions if a != APPROACH] for actions in routes.column("action").to_pylist()]
    for row, actions in (change or {}).items():
        lists[row] = actions
    table = with_column(routes.table, "agent_action", pa.array(lists, list_of(pa.int8())))
    return dataclasses.replace(routes, table=table)


def test_a_release_whose_agents_actions_arrive_has_no_fault(checked: SceneData) -> None:
    assert list(oracle.agent_action_fails(checked, told(checked))) == []


def test_each_fault_of_agents_actions_is_found_and_only_it(checked: SceneData) -> None:
    own, flown = (told(checked).column(name).to_pylist() for name in ("agent_action", "action"))
    with_approach = next(row for row, actions in enumerate(flown) if APPROACH in actions)
    long = [row for row, actions in enumerate(own) if len(actions) > 12 and row != with_approach]
    changes = {
        with_approach: (flown[with_approach], f"action {APPROACH}"),
        long[0]: (own[long[0]][:-1], "no Stop at its end alone"),
        long[1]: ([STOP, *own[long[1]]], "no Stop at its end alone"),
        long[2]: ([STOP], "m from the "),
        long[3]: ([], "no Stop at its end alone"),
        long[4]: ([11] * 30 + [STOP], "flight volume"),
    }
    found = {
        finding.row: finding.found
        for finding in oracle.agent_action_fails(checked, told(checked, {k: v[0] for k, v in changes.items()}))
    }
    assert found.keys() == changes.keys()
    for row, (_, words) in changes.items():
        assert words in found[row], found[row]


def test_other_actions_that_arrive_as_well_are_flown_and_pass(checked: SceneData) -> None:
    # A turn to and fro before the Stop: other actions, the same place.
    own = told(checked).column("agent_action").to_pylist()
    budget = dict(zip(checked["tasks"].texts("nav_id"), checked["tasks"].ints("action_budget").tolist(), strict=True))
    ids = checked["routes"].texts("nav_id")
    turned = {k: [*a[:-1], 14, 15, STOP] for k, a in enumerate(own) if len(a) + 2 <= budget[ids[k]]}
    assert len(turned) > 10
    assert list(oracle.agent_action_fails(checked, told(checked, turned))) == []
