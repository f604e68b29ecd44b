"""annotate-import: the tables of right files, and every fault of wrong ones."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from support.annotation_scenes import street, street_annotations, street_vocabulary

from aerialdojo_gen.annotations.check import SourceCheck
from aerialdojo_gen.annotations.format import Anchor, Landmark, format_annotations, parse_annotations
from aerialdojo_gen.base.config.sections import AnnotateImportConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.errors import AnnotationError, UsageError
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.pipeline.stages.work import annotate_import
from aerialdojo_gen.scenes.model import Scene

ROOT = Path(__file__).resolve().parents[2]


@dataclasses.dataclass(frozen=True)
class _StreetJob(Job):
    """A job whose scene is the hand-made street."""

    def scene_model(self) -> Scene:
        return street()


def _job(tmp_path, text):
    (tmp_path / "U_Street_0.json").write_text(text, encoding="utf-8")
    roots = ProjectPaths(tmp_path, ROOT / "scene_assets", tmp_path, tmp_path)
    return _StreetJob("annotate-import", "U_Street_0", 0, 1, 0, Embodiment(), roots)


def _faults(annotations, scene=None, counts=None):
    return SourceCheck(parse_annotations(format_annotations(annotations)), street_vocabulary(scene), counts).faults


def _changed(k, **changes):
    annotations = street_annotations()
    objects = list(annotations.objects)
    objects[k] = objects[k].model_copy(update=changes)
    return dataclasses.replace(annotations, objects=tuple(objects))


def test_a_missing_file_is_named(tmp_path):
    job = _job(tmp_path, "{}")
    (tmp_path / "U_Street_0.json").unlink()
    with pytest.raises(UsageError, match=r"U_Street_0\.json does not exist"):
        annotate_import.run(job, AnnotateImportConfig())


def test_a_wrong_file_is_refused_whole_with_every_fault(tmp_path):
    annotations = street_annotations(delivery_van_000="A red delivery van.", delivery_van_002=" ")
    text = format_annotations(annotations).replace('"node": "mailbox_001"', '"node": "mailbox_009"')
    with pytest.raises(AnnotationError) as caught:
        annotate_import.run(_job(tmp_path, text), AnnotateImportConfig())
    lines = text.splitlines()
    message = str(caught.value).splitlines()
    assert message[0].endswith("3 faults, nothing imported")
    for path, words in (
        ("objects[0].description", "ambiguous: it fits delivery_van_001"),
        ("objects[2].description", "is empty"),
        ("objects[3].node", "did you mean 'mailbox_001'"),
    ):
        (line,) = [m for m in message if path in m]
        assert words in line
        number = int(line.split(":")[1])
        assert f'"{path.split(".")[1]}"' in lines[number - 1]


_FAR = Anchor(position_m=(900.0, 0.0, 1.0), yaw_deg=0.0)


@pytest.mark.parametrize(
    ("k", "changes", "path", "words"),
    [
        (1, {"id": 0}, "objects[1].id", "objects[0]"),
        (1, {"node": "delivery_van_000"}, "objects[1].node", "objects[0]"),
        (1, {"node": "clock_tower_000"}, "objects[1].node", "a different node"),
        (1, {"category": "mailbox"}, "objects[1].category", "is a 'delivery_van'"),
        (1, {"category": "delivery_vam"}, "objects[1].category", "did you mean 'delivery_van'"),
        (1, {"name": "  "}, "objects[1].name", "empty"),
        (1, {"name": "van_03"}, "objects[1].name", "plain words"),
        (1, {"name": "blue delivery van"}, "objects[1].name", "'blue'"),
        (1, {"description": "\t"}, "objects[1].description", "empty"),
        (2, {"description": "A blue delivery van at 12.5, 3.0."}, "objects[2].description", "coordinates"),
        (2, {"description": "A blue delivery van 10 m away."}, "objects[2].description", "coordinates"),
        (2, {"description": "A blue one by mailbox_000."}, "objects[2].description", "mailbox_000"),
        (2, {"description": "A blue delivery van"}, "objects[2].description", "full stop"),
        (2, {"description": "Blue. It is. A van. Here."}, "objects[2].description", "sentences"),
        (2, {"anchor": _FAR}, "objects[2].anchor.position_m", "bounds"),
    ],
)
def test_each_fault_is_found_at_its_place(k, changes, path, words):
    faults = _faults(_changed(k, **changes))
    assert any(f.path == path and words in f.message for f in faults), [str(f) for f in faults]
    assert all(f.line > 0 for f in faults)


def test_counts_scene_landmarks_and_bounds():
    annotations = street_annotations()
    assert _faults(annotations) == _faults(annotations, counts=(1, 4)) == []
    assert [f.path for f in _faults(annotations, counts=(2, 5))] == ["landmarks", "objects"]
    assert [f.path for f in _faults(dataclasses.replace(annotations, scene="U_Mall_0"))] == ["scene"]
    twice = (*annotations.landmarks, Landmark(id=1, name="Clock tower", node="bench_000"))
    assert [f.path for f in _faults(dataclasses.replace(annotations, landmarks=twice))] == ["landmarks[1].name"]
    assert [f.path for f in _faults(dataclasses.replace(annotations, landmarks=()))] == ["landmarks"]
    small = dataclasses.replace(street(), bounds=np.array([[-35.0, -35.0, 0.0], [35.0, 35.0, 40.0]]))
    assert [f.path for f in _faults(annotations, small)] == ["objects[1].node"]
