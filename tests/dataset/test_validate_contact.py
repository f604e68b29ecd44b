"""The check that nothing hovers finds a thing that is lifted, and no other."""

from dataclasses import replace

import numpy as np
import pytest
from support.planting import outcome_of, scene_data

from aerialdojo_gen.dataset.validate.contact import thing_hovers


@pytest.mark.parametrize(("up_m", "found"), [(0.0, 0), (0.04, 0), (0.3, 1), (30.0, 1)])
def test_a_thing_that_is_lifted_hovers(planted, up_m, found):
    data = scene_data(planted)
    assert not outcome_of(data, "thing_hovers").faults
    scene = data.mesh
    bench = next(i for i in scene.instances if i.category == "bench")
    parts = tuple(replace(p, vertices=p.vertices + np.array([0.0, 0.0, up_m])) for p in bench.parts)
    lifted = tuple(replace(i, parts=parts) if i is bench else i for i in scene.instances)
    data.cache["mesh"] = replace(scene, instances=lifted)
    findings = list(thing_hovers(data, data["scenes"]))
    assert [bench.node in f.found for f in findings] == [True] * found
