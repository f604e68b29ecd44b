"""TOML and JSON within bounds: what is refused, and where the message says that it stands."""

import contextlib
import json
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.base import safe_parse
from aerialdojo_gen.base.errors import AssetError, BeyondBounds, StoreError
from aerialdojo_gen.base.safe_parse import (
    MAX_DEPTH,
    MAX_INTEGER,
    exceeds_depth,
    loads_json,
    loads_toml,
    read_json,
    read_toml,
)

HOSTILE_TOML = {
    "x = 1\na = " + "[" * 50_000: "line 2, column 69: nested more than 64 deep",
    "a." * 50_000 + "a = 1": "line 1, column 130: a key of more than 64 parts",
    'a = {"b".' + '"c".' * 50_000 + "d = 1}": "a key of more than 64 parts",
    "\n\na = " + "1" * 5000: "line 3, column 5: a number of 5,000 digits",
    "a = 0x" + "f" * 5000: "a: is an integer beyond 64 bits",
    "[t]\na = [1, 18446744073709551616]": "t.a[1]: is an integer beyond 64 bits",
    "a = [{b = -inf}]": "a[0].b: is -inf, no finite number",
    'a = "x\\u0000"': "a: has a NUL character",
    '"\\u0000" = 1': "has a key that has a NUL character",
    'a = "\\ud800"': "not a Unicode scalar value",
    f'a = "{"x" * 2001}"': "a: has 2,001 characters, the most is 2,000",
    'a = """': "Unterminated string",
    "a = 2020-13-45": "line 1",
}
HOSTILE_JSON = {
    "[" * 50_000: "line 1, column 65: nested more than 64 deep",
    '{"a":' * 500 + "1" + "}" * 500: "is nested more than 64 deep",
    '{"a":\n [1, ' + "9" * 5000 + "]}": "line 2, column 6: a number of 5,000 digits",
    '{"a": [1, 9223372036854775808]}': "a[1]: is an integer beyond 64 bits",
    '{"a": [NaN]}': "NaN is no finite number",
    '{"a": {"b": -1e999}}': "a.b: is -inf, no finite number",
    '{"a": {"b": "x\\ud800"}}': "a.b: has half a Unicode character",
    '{"\\udfff": 1}': "has a key that has half a Unicode character",
    '[0, "\\u0000"]': "[1]: has a NUL character",
    '{"a": ': "line 1, column 7: is not JSON",
}


def test_what_is_beyond_the_bounds_is_refused_with_its_place(tmp_path):
    path = tmp_path / "a"
    for read, hostile in ((read_toml, HOSTILE_TOML), (read_json, HOSTILE_JSON)):
        for text, words in hostile.items():
            path.write_text(text)
            with pytest.raises(AssetError) as refused:
                read(path, AssetError)
            message = str(refused.value)
            assert message.startswith(f"{path}: ")
            assert words in message
            assert "\n" not in message
            assert len(message) < 500


def test_files_that_are_no_text_or_too_large(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b'a = 1\nb = "\xff"')
    for read in (read_toml, read_json):
        with pytest.raises(StoreError, match="line 2: is not UTF-8"):
            read(path)
        with pytest.raises(StoreError, match="cannot be read"):
            read(tmp_path)
        with pytest.raises(FileNotFoundError):
            read(tmp_path / "none")
    path.write_bytes(b" " * 1025)
    with pytest.raises(StoreError, match="is larger than 1 KiB"):
        read_json(path, limit=1024)


def test_what_lies_on_the_bounds_is_taken():
    deepest = "[" * (MAX_DEPTH - 1) + "]" * (MAX_DEPTH - 1)
    assert loads_json(deepest) == json.loads(deepest)
    assert loads_toml(f"a = {deepest}") == tomllib.loads(f"a = {deepest}")
    assert loads_json(f"[{MAX_INTEGER}, {-MAX_INTEGER - 1}]") == [MAX_INTEGER, -MAX_INTEGER - 1]
    assert loads_json('"\\ud83d\\ude00"') == "\U0001f600"
    assert loads_json("\ufeff[1]".encode()) == [1]
    assert loads_json("[NaN, 1e999]", finite=False)[1] == float("inf")
    assert isinstance(BeyondBounds("x"), ValueError)


def test_brackets_dots_and_digits_in_strings_and_comments_count_for_nothing():
    noise = "[{" * 200 + "." * 200 + "9" * 1000
    quoted = f"# {noise}\na = \"{noise}\"\nb = '{noise}'\nc = [1.5, 2.5] # '\n"
    assert loads_toml(quoted) == tomllib.loads(quoted)
    longer = "[{" * 100 + '"' + "." * 100
    whole = f'd = """{longer}\\""" {longer}""""\ne = \'\'\'{longer}\'{longer}\'\'\'\nf = 1'
    assert loads_toml(whole) == tomllib.loads(whole)
    assert loads_json(json.dumps({noise: noise})) == {noise: noise}


def test_every_file_of_ours_is_read_as_the_standard_library_does(project):
    # The plans of scenes/ are read by all that builds them.
    places = ("scene_assets/*.toml", "scene_assets/props/*.toml", "pipelines/**/*.toml", "aerialdojo_gen/**/*.toml")
    paths = [path for place in places for path in project.glob(place)]
    assert len(paths) > 40
    for path in paths:
        assert read_toml(path) == tomllib.loads(path.read_text(encoding="utf-8"))


plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0")),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0")), inner, max_size=4),
    max_leaves=20,
)  # fmt: skip


@given(st.integers(0, 200), st.booleans())
def test_depth_is_the_same_to_all_that_measure_it(depth, tables):
    value: object = 1
    for _ in range(depth):
        value = {"a": value} if tables else [value]
    refused = depth > MAX_DEPTH
    assert (safe_parse.find_violation(value) is not None) == refused
    assert exceeds_depth(value) == refused
    for read in (loads_json, safe_parse.scan_json):
        with pytest.raises(BeyondBounds) if refused else contextlib.nullcontext():
            read(json.dumps(value))


beyond = st.sampled_from([2**63, -(2**63) - 1, 10**30, float("inf"), "\ud800", "\0", "x\0", "\udfff"])
odd = st.sampled_from(["[", "]", "{}", '"', '"]', "\\", "a[0]", "#9e4000", "1e999", "9" * 19, "é", 1e300, 0.1 + 0.2])


@given(st.recursive(
    plain | beyond | odd,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text() | st.just("]["), inner, max_size=4),
), st.booleans())  # fmt: skip
def test_json_is_what_the_standard_library_reads_or_refused_where_a_value_is_beyond_the_bounds(value, ascii_only):
    text = json.dumps(value, ensure_ascii=ascii_only).replace("Infinity", "1e999")
    if safe_parse.find_violation(json.loads(text)) is None:
        assert loads_json(text) == loads_json(text.encode()) == json.loads(text)
        safe_parse.scan_json(text)
        assert not exceeds_depth(json.loads(text))
    else:
        with pytest.raises(BeyondBounds):
            loads_json(text)


FRAGMENTS = (
    "a = 1\n", "b.c = ", "[t]\n", "[[t]]\n", "[" * 40, "]" * 40, "{", "}", '"', "'", '"""', "'''", "\\", "\\\n", "#",
    "1" * 999, "_1" * 500, "0x", "f" * 999, ".x" * 40, '"a".', "\n", " = ", ",", "x", '["]"]', "nan", "\0",
)  # fmt: skip


@given(st.lists(st.sampled_from(FRAGMENTS), max_size=12).map("".join))
def test_a_glance_at_toml_passes_nothing_that_the_scan_refuses(text):
    if safe_parse._plain_toml(text):
        safe_parse._scan(text, safe_parse._TOML_TOKEN)


ATOMS = st.sampled_from([
    0, 1.5, True, "x", "é", "\0", "\ud800", "y" * 30, 2**63, -(2**63), -(2**63) - 1, float("nan"), float("inf"), None,
])  # fmt: skip


@given(
    st.recursive(ATOMS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner)),
    st.integers(0, 70),
)
def test_a_glance_at_a_value_passes_nothing_that_the_search_finds(value, depth):
    for _ in range(depth):
        value = [value]
    if safe_parse._sound(value, True, 20):
        assert safe_parse.find_violation(value, longest=20) is None
