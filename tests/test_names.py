"""What people call by name: nearest names, messages, scenes by glob; Pydantic's errors in words."""

import pytest
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.explain import explain, faults_of
from aerialdojo_gen.base.names import choose_scenes, closest, did_you_mean, nearest, unknown

SCENES = ["N_Forest_0", "U_Mall_0", "U_Mall_1"]


def test_the_nearest_names_whatever_the_case():
    assert closest("u_mal_1", SCENES, 2) == ["U_Mall_1", "U_Mall_0"]
    assert closest("zzz", SCENES) == []
    assert closest("zzz", SCENES, cutoff=0.0) != []
    assert did_you_mean("u_mall_1", SCENES) == "did you mean 'U_Mall_1'?"
    assert did_you_mean("Mall", ["Mall_a", "Mall_b", "Mall_c"], 3) == "did you mean 'Mall_c', 'Mall_b' or 'Mall_a'?"
    assert (nearest("boxs", ["box"]), nearest("sphere", ["box"])) == (": did you mean 'box'?", "")


def test_what_is_like_nothing_is_told_what_there_is():
    assert unknown("no agent", "xyz", ["oracle"]) == "no agent 'xyz': there is oracle"
    assert unknown("no agent", "xyz", ["oracle"], besides=("or a:B",)) == "no agent 'xyz': there are oracle, or a:B"
    assert unknown("no run", "xyz", []) == "no run 'xyz': there is none"
    many = unknown("no task", "xyz", [f"task-{k}" for k in range(5000)])
    assert many.endswith("task-19 and 4,980 more")
    assert len(unknown("no task", "x" * 10_000, ["a"])) < 200


def test_scenes_by_name_and_glob():
    assert choose_scenes(["*_0", "U_Mall_0"], SCENES) == ["N_Forest_0", "U_Mall_0"]
    assert choose_scenes(None, SCENES) == choose_scenes((), SCENES) == SCENES
    with pytest.raises(UsageError, match="no scene 'U_Mal_0': did you mean 'U_Mall_0' or 'U_Mall_1'"):
        choose_scenes(["N_*", "U_Mal_0"], SCENES)
    with pytest.raises(UsageError, match="no scene 'u_mall_0'"):
        choose_scenes(["u_mall_0"], SCENES)
    with pytest.raises(UsageError, match="there are no scenes"):
        choose_scenes(["*"], [])


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")
    weight: float = 1.0


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: str
    inner: Inner | None = None
    several: tuple[Inner, ...] = ()

    @model_validator(mode="after")
    def _agree(self):
        if self.name == "bad":
            raise ValueError("name contradicts inner; inner contradicts name")
        return self


def refused(value):
    with pytest.raises(ValidationError) as error:
        Outer.model_validate(value)
    return error.value


@pytest.mark.parametrize(
    ("value", "lines"),
    [
        ({"nam": "a"}, ["key 'name' is missing", "unknown key 'nam': did you mean 'name'?"]),
        ({"name": "a", "inner": {"wieght": 1}}, ["[inner] unknown key 'wieght': did you mean 'weight'?"]),
        ({"name": "a", "several": [{}, {"wieght": 1}]}, ["[several.1] unknown key 'wieght': did you mean 'weight'?"]),
        ({"name": "a", "inner": {"weight": "x" * 900}}, ["[inner] weight = 'xxx"]),
        ({"name": "a", "several": [1]}, ["several.0 = 1: Input should be a valid dict"]),
        ({"name": "bad"}, ["name contradicts inner", "inner contradicts name"]),
    ],
)
def test_faults_of_a_model_in_words(value, lines):
    told = explain(refused(value), Outer)
    assert len(told) == len(lines)
    assert all(line.startswith(start) for line, start in zip(told, lines, strict=True)), told
    assert max(map(len, told)) < 200


def test_faults_have_their_place():
    faults = faults_of(refused({"several": [{"weight": "a"}]}), Outer)
    assert [(fault.path, fault.message) for fault in faults] == [
        (("name",), "the key is missing"),
        (("several", 0, "weight"), "Input should be a valid number, unable to parse string as a number"),
    ]


def test_many_faults_are_counted():
    error = refused({"name": "a", **{f"k{i}": 0 for i in range(30)}})
    assert explain(error, Outer)[-1] == "and 10 more faults"
