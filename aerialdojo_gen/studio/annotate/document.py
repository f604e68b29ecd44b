"""Operations on annotations, and the edits of single entries that they become.

An edit stores its entry before and after: it can be undone and checked for conflicts with changes of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, StrictInt, StrictStr

from aerialdojo_gen.annotations.format import Anchor, Annotations, Landmark, Object, Strict
from aerialdojo_gen.base.errors import AerialDojoError

Kind = Literal["landmarks", "objects"]
Entry = Landmark | Object
MAX_ENTRIES = 5000


class ConflictError(AerialDojoError):
    """An operation does not fit the annotations as they are: somebody else changed them meanwhile."""


def _no_control_characters(text: str) -> str:
    if any(ord(c) < 32 or 0x7F <= ord(c) < 0xA0 or 0xD800 <= ord(c) < 0xE000 for c in text):
        raise ValueError("control characters are not allowed")
    return text


def _line(most: int) -> Any:
    return Annotated[StrictStr, Field(max_length=most), AfterValidator(_no_control_characters)]


_Name, _Node, _Text = _line(120), _line(200), _line(2000)
_Id = Annotated[StrictInt, Field(ge=0, le=2**31 - 1)]


class Fields(Strict):
    """Values of an entry's keys; a key that is left out stays as it is."""

    name: _Name | None = None  # type: ignore[valid-type]
    category: _Name | None = None  # type: ignore[valid-type]
    description: _Text | None = None  # type: ignore[valid-type]
    node: _Node | None = None  # type: ignore[valid-type]
    anchor: Anchor | None = None

    def set_values(self) -> dict[str, Any]:
        """The values that were given; of those only an anchor may be None, which takes it away."""
        values = {key: getattr(self, key) for key in self.model_fields_set}
        return {key: value for key, value in values.items() if value is not None or key == "anchor"}


class Add(Strict):
    """Add an entry; it gets the next id."""

    do: Literal["add"]
    kind: Kind
    fields: Fields


class Change(Strict):
    """Change fields of an entry."""

    do: Literal["change"]
    kind: Kind
    id: _Id
    fields: Fields


class Remove(Strict):
    """Remove an entry; its id is not used again."""

    do: Literal["remove"]
    kind: Kind
    id: _Id


Operation = Annotated[Add | Change | Remove, Field(discriminator="do")]


class Edit(Strict):
    """One entry before and after."""

    kind: Kind
    id: _Id  # Of the entry
    index: Annotated[StrictInt, Field(ge=0)]  # Its place in the list
    before: Object | Landmark | None  # None where the entry is not there
    after: Object | Landmark | None

    def reversed(self) -> Edit:
        """The edit that takes this one back."""
        return Edit(kind=self.kind, id=self.id, index=self.index, before=self.after, after=self.before)


def find(annotations: Annotations, kind: Kind, entry_id: int) -> tuple[int, Entry] | None:
    """Find an entry and its place in its list by its id."""
    entries: Sequence[Entry] = getattr(annotations, kind)
    return next(((k, entry) for k, entry in enumerate(entries) if entry.id == entry_id), None)


def edits_of(operation: Operation, annotations: Annotations, next_id: int) -> list[Edit]:
    """Turn an operation into edits of the annotations as they are."""
    kind, model = operation.kind, Landmark if operation.kind == "landmarks" else Object
    before: Entry | None = None
    after: Entry | None = None
    if isinstance(operation, Add):
        entry_id, index = next_id, len(getattr(annotations, kind))
        if index >= MAX_ENTRIES:
            raise AerialDojoError(f"there are {index} {kind} already, the maximum")
        empty = {key: "" for key in model.model_fields if key not in ("id", "anchor")}
        after = _entry(model, empty | {"id": next_id} | operation.fields.set_values())
    else:
        entry_id, match = operation.id, find(annotations, kind, operation.id)
        if match is None:
            raise ConflictError(f"{kind[:-1]} {entry_id} no longer exists")
        index, before = match
        if isinstance(operation, Change):
            after = _entry(model, before.model_dump() | operation.fields.set_values())
    return [] if after == before else [Edit(kind=kind, id=entry_id, index=index, before=before, after=after)]


def _entry(model: type[Entry], values: dict[str, Any]) -> Entry:
    unknown = values.keys() - model.model_fields.keys()
    if unknown:
        raise AerialDojoError(f"a {model.__name__.lower()} has no {', '.join(sorted(unknown))}")
    # An empty text is none: the program makes one.
    return model(**{key: value for key, value in values.items() if key != "description" or value})


def apply(annotations: Annotations, edits: Sequence[Edit]) -> Annotations:
    """Apply edits to annotations."""
    lists: dict[str, list[Any]] = {"landmarks": [*annotations.landmarks], "objects": [*annotations.objects]}
    for edit in edits:
        entries = lists[edit.kind]
        at = next((k for k, entry in enumerate(entries) if entry.id == edit.id), None)
        if (None if at is None else entries[at]) != edit.before:
            raise ConflictError(f"{edit.kind[:-1]} {edit.id} has been changed since")
        place = slice(edit.index, edit.index) if at is None else slice(at, at + 1)
        entries[place] = [] if edit.after is None else [edit.after]
    return Annotations(annotations.scene, tuple(lists["landmarks"]), tuple(lists["objects"]))


def difference(before: Annotations, after: Annotations) -> list[Edit]:
    """Find the edits that make one state of the entries into another; those that stay keep their order."""
    edits: list[Edit] = []
    kinds: tuple[Kind, ...] = ("landmarks", "objects")
    for kind in kinds:
        old: dict[int, Entry] = {entry.id: entry for entry in getattr(before, kind)}
        new: dict[int, Entry] = {entry.id: entry for entry in getattr(after, kind)}
        for k, (entry_id, entry) in reversed([*enumerate(old.items())]):
            if entry_id not in new:
                edits.append(Edit(kind=kind, id=entry_id, index=k, before=entry, after=None))
        for k, (entry_id, entry) in enumerate(new.items()):
            if old.get(entry_id) != entry:
                edits.append(Edit(kind=kind, id=entry_id, index=k, before=old.get(entry_id), after=entry))
    return edits


def describe_entry(kind: str, entry: Entry) -> str:
    """Name an entry for people."""
    return f"{kind[:-1]} {entry.id}" + (f" ({entry.name})" if entry.name else "")


def describe(edits: Sequence[Edit]) -> str:
    """Say in a few words what edits do, for people."""
    if not edits:
        return "nothing"
    words = []
    for edit in edits[:3]:
        entry = edit.after or edit.before
        assert entry is not None
        thing = describe_entry(edit.kind, entry)
        if edit.before is None:
            words.append(f"added {thing}")
        elif edit.after is None:
            words.append(f"removed {thing}")
        else:
            old, new = edit.before.model_dump(), edit.after.model_dump()
            words.append(f"{', '.join(k for k in new if new[k] != old[k])} of {thing}")
    return "; ".join(words) + (f" and {len(edits) - 3} more" if len(edits) > 3 else "")
