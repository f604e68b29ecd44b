"""A journal that a lost worker has begun."""

from aerialdojo_gen.benchmark.journal import Journal, read_journal


def test_a_journal_that_was_begun_is_gone_on_with(tmp_path):
    path = tmp_path / "journal" / "U_Mall_0.0000.jsonl"
    with Journal(path) as journal:
        assert journal.done == frozenset()
        journal.add({"task_id": "a"})
    with path.open("ab") as file:
        file.write(b'{"task_id": "b"')
    with Journal(path) as journal:
        assert journal.done == {"a"}
        journal.add({"task_id": "c"})
    assert [record["task_id"] for record in read_journal(path)] == ["a", "c"]
