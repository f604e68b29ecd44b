"""The annotation tool without a server: operations, undo, versions, crashes."""

import hashlib
import itertools
import json
import shutil
import threading
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter
from support.preload import killed_at

from aerialdojo_gen.annotations.format import Annotations, Landmark, Object, format_annotations, parse_annotations
from aerialdojo_gen.base.errors import AnnotationError, StoreError
from aerialdojo_gen.studio.annotate.document import ConflictError, Operation, apply, describe, difference, edits_of
from aerialdojo_gen.studio.annotate.storage import Author, StaleError, Storage

OPERATION = TypeAdapter(Operation)
ADA, BEN = Author("Ada", "tab-a"), Author("Ben", "tab-b")


def asked(**operation):
    return OPERATION.validate_json(json.dumps(operation))


def rename(name, entry_id=0):
    return asked(do="change", kind="objects", id=entry_id, fields={"name": name})


def add(name):
    return asked(do="add", kind="objects", fields={"name": name, "node": f"{name}_000"})


@pytest.fixture
def storage(tmp_path) -> Storage:
    objects = tuple(
        Object(id=k, name=f"thing {k}", category="thing", description="A thing.", node=f"thing_{k:03d}")
        for k in (0, 1, 5)
    )
    start = Annotations("U_Yard_0", (Landmark(id=0, name="tower", node="tower_000"),), objects)
    (tmp_path / "U_Yard_0.json").write_text(format_annotations(start))
    return Storage(tmp_path, "U_Yard_0")


def on_disk(storage):
    return hashlib.sha256(storage.path.read_bytes()).hexdigest()


texts = st.text(st.characters(blacklist_categories=("Cs", "Cc")), max_size=20)
anchors = st.builds(
    lambda p, y: {"position_m": p, "yaw_deg": y},
    st.lists(st.floats(-500, 500), min_size=3, max_size=3), st.floats(-180, 180),
)  # fmt: skip
fields = st.fixed_dictionaries(
    {}, optional={"name": texts, "category": texts, "description": texts, "anchor": st.none() | anchors}
)
operations = st.one_of(
    st.builds(lambda f: {"do": "add", "kind": "objects", "fields": f}, fields),
    st.builds(lambda f, i: {"do": "change", "kind": "objects", "id": i, "fields": f}, fields, st.integers(0, 8)),
    st.builds(lambda i: {"do": "remove", "kind": "objects", "id": i}, st.integers(0, 8)),
    st.builds(lambda i: {"do": "remove", "kind": "landmarks", "id": i}, st.integers(0, 3)),
    st.builds(lambda n: {"do": "add", "kind": "landmarks", "fields": {"name": n}}, texts),
)  # fmt: skip


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(operations, max_size=8))
def test_undo_gives_back_every_byte_and_redo_every_change(tmp_path_factory, todo):
    folder = tmp_path_factory.mktemp("undo")
    storage = Storage(folder, "U_Yard_0")
    state = storage.load()
    texts_before = [state.text]
    for operation in todo:
        try:
            state, record = storage.change(state.version, ADA, asked(**operation))
        except ConflictError:
            continue
        if record:
            texts_before.append(state.text)
    for text in reversed(texts_before[:-1]):
        state, record = storage.undo(state.version, ADA)
        assert record.action == "undo"
        assert state.text == (text or format_annotations(Annotations("U_Yard_0", (), ())))
    assert storage.undo(state.version, ADA)[1] is None
    # Another process, and the reload of a page, know as much.
    again = Storage(folder, "U_Yard_0")
    for text in texts_before[1:]:
        state, record = again.redo(state.version, ADA)
        assert (record.action, state.text) == ("redo", text)
    assert again.redo(state.version, ADA)[1] is None


@settings(max_examples=60)
@given(st.lists(operations, max_size=6), st.lists(operations, max_size=6))
def test_the_difference_of_two_states_leads_from_one_to_the_other(first, second):
    def made(todo):
        annotations = Annotations("U_Yard_0", (), ())
        for k, operation in enumerate(todo):
            try:
                annotations = apply(annotations, edits_of(asked(**operation), annotations, k))
            except ConflictError:
                continue
        return annotations

    before, after = made(first), made(second)
    edits = difference(before, after)
    reached = apply(before, edits)
    assert {e.id: e for e in reached.objects} == {e.id: e for e in after.objects}
    assert {e.id: e for e in reached.landmarks} == {e.id: e for e in after.landmarks}
    assert apply(reached, [edit.reversed() for edit in reversed(edits)]) == before
    assert (describe(edits) == "nothing") == (not edits)


def test_a_change_is_on_disk_when_it_is_answered_and_the_history_says_whose_it_was(storage):
    state = storage.load()
    after, record = storage.change(state.version, ADA, rename("red van"))
    assert storage.path.read_text() == after.text == format_annotations(after.annotations)
    assert after.version == on_disk(storage)
    line = json.loads(storage.history.path.read_text())
    assert (line["who"], line["action"], line["what"]) == ("Ada", "do", "name of object 0 (red van)")
    assert (line["before"], line["after"]) == (state.version, after.version)
    assert record.time == line["time"]
    assert line["time"].endswith("+00:00")
    # An id is not used again.
    after, _ = storage.change(after.version, ADA, asked(do="remove", kind="objects", id=5))
    assert storage.change(after.version, ADA, add("new"))[1].edits[0].id == 6


def test_opening_and_saving_without_a_change_writes_nothing(storage, project):
    before, stamp = storage.path.read_bytes(), storage.path.stat()
    state = storage.load()
    state, record = storage.change(state.version, ADA, rename("thing 0"))
    assert record is None
    assert storage.path.read_bytes() == before
    assert (storage.path.stat().st_mtime_ns, storage.path.stat().st_ino) == (stamp.st_mtime_ns, stamp.st_ino)
    # Nor does a change and its undo leave a trace in a file that is as the program writes it.
    state, _ = storage.change(state.version, ADA, rename("something else"))
    assert storage.path.read_bytes() != before
    storage.undo(state.version, ADA)
    assert storage.path.read_bytes() == before
    for path in sorted((project / "annotations").glob("[UNID]_*_[01].json")):
        text = path.read_text(encoding="utf-8")
        assert format_annotations(parse_annotations(text).annotations) == text, path.name


def test_undo_takes_back_ones_own_and_never_what_another_changed_since(storage):
    state, _ = storage.change(storage.load().version, ADA, rename("ada"))
    state, _ = storage.change(state.version, BEN, rename("ben", entry_id=1))
    state, _ = storage.undo(state.version, ADA)
    assert [o.name for o in state.annotations.objects] == ["thing 0", "ben", "thing 5"]
    state, _ = storage.redo(state.version, ADA)
    state, _ = storage.change(state.version, BEN, rename("ben was here"))
    with pytest.raises(ConflictError, match="object 0 has been changed since"):
        storage.undo(state.version, ADA)
    assert storage.load().version == state.version


def test_many_people_at_once_lose_nothing(storage):
    """Threads with storages of their own, as several servers would have: every one retries until it is its turn."""

    def work(k):
        mine = Storage(storage.path.parent, "U_Yard_0")
        for n in range(5):
            while True:
                try:
                    mine.change(mine.load().version, Author(f"p{k}", f"tab-{k}"), add(f"thing-{k}-{n}"))
                    break
                except StaleError:
                    time.sleep(0.001)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    objects = storage.load().annotations.objects
    assert {o.name for o in objects[3:]} == {f"thing-{k}-{n}" for k in range(4) for n in range(5)}
    assert len({o.id for o in objects}) == len(objects) == 23
    records = [json.loads(line) for line in storage.history.path.read_text().splitlines()]
    assert all(a["after"] == b["before"] for a, b in itertools.pairwise(records))


def test_a_change_of_the_file_by_an_editor_counts(storage):
    state, _ = storage.change(storage.load().version, ADA, rename("ada"))
    text = storage.path.read_text().replace("thing 1", "edited")
    storage.path.write_text(text)
    with pytest.raises(StaleError):
        storage.change(state.version, ADA, rename("again"))
    state, _ = storage.change(storage.load().version, ADA, rename("again"))
    assert [o.name for o in state.annotations.objects][:2] == ["again", "edited"]
    assert [r.action for r in storage.history.records] == ["do", "outside", "do"]
    storage.path.write_text(text[:-20])
    with pytest.raises(AnnotationError, match=r"U_Yard_0\.json: line \d+: not JSON"):
        storage.change(state.version, ADA, rename("lost"))
    assert storage.path.read_text() == text[:-20]


TWICE = (
    '{"format": "aerialdojo-annotations", "version": 1, "scene": "U_Yard_0", "objects": [], "landmarks": '
    '[{"id": 0, "name": "a", "node": "a"}, {"id": 0, "name": "b", "node": "b"}]}'
)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[]", "must be an object"), ("\xff\xfe", "U_Yard_0.json is not UTF-8"), ("{" * 99999, "not"),
        (TWICE, "duplicate id in landmarks"), (TWICE.replace("Yard", "Mall"), "is of scene 'U_Mall_0'"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_kept_whole_is_not_opened(tmp_path, text, why):
    (tmp_path / "U_Yard_0.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(AnnotationError, match=why):
        Storage(tmp_path, "U_Yard_0").load()
    with pytest.raises(StoreError, match="not a scene name"):
        Storage(tmp_path / "below", "../U_Yard_0")


def test_a_line_of_the_history_that_a_crash_cut_is_passed_over(storage):
    state, _ = storage.change(storage.load().version, ADA, rename("first"))
    with storage.history.path.open("a") as file:
        file.write('{"time": "2026-')
    fresh = Storage(storage.path.parent, "U_Yard_0")
    state, _ = fresh.change(fresh.load().version, ADA, rename("second"))
    lines = [json.loads(line) for line in fresh.history.path.read_text().splitlines()]
    assert [line["action"] for line in lines] == ["do", "do"]
    state, _ = fresh.undo(state.version, ADA)
    assert state.annotations.objects[0].name == "first"


SAVE = """
import sys
from pathlib import Path
from aerialdojo_gen.studio.annotate.document import Add, Fields
from aerialdojo_gen.studio.annotate.storage import Author, Storage
storage = Storage(Path(sys.argv[1]), "U_Yard_0")
new = Add(do="add", kind="objects", fields=Fields(name="new"))
storage.change(storage.load().version, Author("Ada", "tab-a"), new)
Path(sys.argv[1], "answered").touch()
"""


@pytest.mark.kill
def test_killed_at_any_call_of_a_save_all_of_it_is_there_or_nothing(storage, tmp_path_factory):
    before, folder, found = storage.load(), tmp_path_factory.mktemp("killed"), []
    with killed_at(SAVE, WRITES="1") as run:
        for n in itertools.count(1):
            here = shutil.copytree(storage.path.parent, folder / str(n))
            ended = run(n, here)
            again = Storage(here, "U_Yard_0")
            state = again.load()
            assert state.version == before.version or [o.name for o in state.annotations.objects[3:]] == ["new"]
            assert state.version == on_disk(again)
            assert state.text == format_annotations(state.annotations)
            assert not list(here.glob(".*"))
            found.append(state.version != before.version)
            assert found[-1] or not (here / "answered").exists()
            # Whoever comes next may change it.
            again.change(state.version, BEN, rename("after"))
            records = [json.loads(line) for line in again.history.path.read_text().splitlines()]
            assert len(records) == 1 + found[-1]
            assert records[-1]["after"] == on_disk(again)
            if not ended:
                break
    assert found == sorted(found)
    assert 2 < sum(found) < len(found) - 2
