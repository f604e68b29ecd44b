"""The annotation format: exact round trips, and every fault of form by line and path."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.annotation_scenes import street_annotations

from aerialdojo_gen.annotations.format import (
    Anchor,
    Annotations,
    Landmark,
    Object,
    format_annotations,
    parse_annotations,
    read_json,
    write_annotations,
)

_number = st.floats(-1e6, 1e6)
_anchor = st.builds(Anchor, position_m=st.tuples(_number, _number, _number), yaw_deg=_number)
_id = st.integers(0, 2**31 - 1)
_text = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))
_annotations = st.builds(
    Annotations,
    scene=_text,
    landmarks=st.lists(st.builds(Landmark, id=_id, name=_text, node=_text), max_size=3).map(tuple),
    objects=st.lists(
        st.builds(
            Object, id=_id, name=_text, category=_text, description=_text, node=_text, anchor=st.none() | _anchor
        ),
        max_size=3,
    ).map(tuple),
)


@given(_annotations)
def test_round_trip_is_exact(annotations):
    text = format_annotations(annotations)
    source = parse_annotations(text)
    assert source.faults == ()
    assert source.annotations == annotations
    assert format_annotations(source.annotations) == text


def test_one_key_a_line_and_replaced_whole(tmp_path):
    path = tmp_path / "U_Street_0.json"
    write_annotations(street_annotations(), path)
    text = path.read_text(encoding="utf-8")
    assert text.endswith("}\n")
    assert all(line.count('": ') <= 1 for line in text.splitlines())
    assert [p.name for p in tmp_path.iterdir()] == ["U_Street_0.json"]


_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | _text,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_text, inner, max_size=4),
)


@given(_json, st.sampled_from([None, 1, 3]))
def test_positions_agree_with_the_standard_parser(value, indent):
    text = json.dumps(value, indent=indent)
    document = read_json(text)
    assert document.faults == ()
    assert document.value == json.loads(text)
    assert document.lines[()] == 1
    assert max(document.lines.values()) <= text.count("\n") + 1


def test_lines_are_those_of_the_values():
    text = '{\n "a": [\n  1,\n  {"b":\n   2}\n ]\n}'
    assert read_json(text).lines == {(): 1, ("a",): 2, ("a", 0): 3, ("a", 1): 4, ("a", 1, "b"): 5}


FILE = '{"format": "aerialdojo-annotations", "version": 1, "scene": "U_Yard_0", "landmarks": [], "objects": [\n%s]}'
ENTRY = '{"id": 0, "name": "van", "category": "delivery_van", "description": "A van.", "node": "delivery_van_000"}'
LONG = "a" * 100_000


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", 1, "not JSON"),
        ("\ufeff{}", 1, "not JSON"),
        ('{\n"format": "x",,}', 2, "not JSON"),
        ("[1]", 1, "must be an object"),
        ("[" * 100_000, 0, "line 1, column 65: nested more than 64 deep"),
        (FILE % ("[" * 50_000), 0, "nested more than 64 deep"),
        (FILE % "0,".join([""] * 300_000), 0, "holds more than 200000 values"),
        (FILE % ENTRY.replace("A van.", "\\ud800"), 2, "\\ud800 is half of a surrogate pair: no character"),
        (FILE % ENTRY.replace('"name"', '"\\udfff"'), 2, "\\udfff is half of a surrogate pair: no character"),
        (FILE.replace("U_Yard_0", "\\udc00") % ENTRY, 1, "\\udc00 is half of a surrogate pair: no character"),
        (FILE % ENTRY.replace('"id": 0', '"id": ' + "9" * 5000), 0, "digits"),
        ('{"scene": "a",\n "scene": "b"}', 2, "occurs twice"),
        (f'{{"{LONG}": 1, "{LONG}": 2}}', 1, "occurs twice"),
        (f'{{"version": 1, "{LONG}": 0, "scene": "{LONG}"}}', 1, "unknown key"),
    ],
)
def test_faults_of_the_text_are_told_in_few_words(text, line, words):
    faults = parse_annotations(text).faults
    assert any(f.line == line and words in f.message for f in faults), [str(f) for f in faults]
    assert max(len(str(fault)) for fault in faults) < 700


def test_every_fault_of_form_is_listed():
    lines = format_annotations(street_annotations()).splitlines()
    anchor = '"name": "x", "anchor": {"position_m": [1, 2], "yaw_deg": NaN},'
    expected = set()
    for old, new, *paths in (
        ('"version": 1,', '"version": 2,', "version"),
        ('"node": "clock_tower_000"', '"nod": "clock_tower_000"', "landmarks[0].nod"),
        ('"id": 1,', '"id": "one",', "objects[1].id"),
        ('"id": 2,', '"id": true,', "objects[2].id"),
        ('"name": "blue delivery van",', anchor, "objects[2].anchor.position_m[2]", "objects[2].anchor.yaw_deg"),
    ):
        k = next(i for i, line in enumerate(lines) if line.strip() == old)
        lines[k] = new
        expected |= {(k + 1, path) for path in paths}
    source = parse_annotations("\n".join(lines))
    assert expected <= {(f.line, f.path) for f in source.faults}
    assert any("did you mean 'node'?" in f.message for f in source.faults)
    assert any(f.path == "landmarks[0].node" and "missing" in f.message for f in source.faults)
    assert sorted(source.objects) == [0, 3]
