"""Checks that `tasks` tells an agent nothing of the target's place, and that no task stands there twice.

Ids reveal nothing either: made with a key, not to be enumerated, and independent of all that is withheld. Where the
pipeline has the salt that the release was made with, every id is computed again. Where it has not, ids are held
against the hashes that anybody could compute, and against chance: whether their digits go with the target, the start,
the landmark, the direction or the length more often than digits that were drawn.
"""

from __future__ import annotations

import hashlib
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import START, Ints, Rows, SceneData, Texts, UncheckedError, at, repeated
from aerialdojo_gen.pipeline.stages.work.split import key_of, nav_id, reference_id

_SAME_M = 1e-9
# Digits with a decimal point: no description of the project's has any, a coordinate always does.
_DECIMAL = re.compile(r"\d[.,]\d")
_DIGITS = 12
# Standard deviations from chance beyond which digits leak something, and drawings that chance is measured by.
_DEVIATIONS, _DRAWINGS = 7.0, 24
# Fewer ids than this are no evidence.
_FEW = 40
_LENGTH_BINS = 8
# A route whose ends are not its own has been named: its id is another pair's for that reason.
_OTHER_PAIR = (
    "duplicate_key", "duplicate_route", "unknown_target", "unknown_start", "start_anchor", "goal_anchor",
    "end_position",
)  # fmt: skip
_HASHES: tuple[Callable[[bytes], str], ...] = (
    lambda raw: hashlib.blake2b(raw, digest_size=6).hexdigest(),
    lambda raw: hashlib.blake2b(raw).hexdigest()[:_DIGITS],
    lambda raw: hashlib.md5(raw, usedforsecurity=False).hexdigest()[:_DIGITS],
    lambda raw: hashlib.sha1(raw, usedforsecurity=False).hexdigest()[:_DIGITS],
    lambda raw: hashlib.sha256(raw).hexdigest()[:_DIGITS],
    lambda raw: f"{zlib.crc32(raw):012x}",
)


@check("tasks")
def telling_id(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Ids are the scene and a hash: an agent reads no object out of them."""
    nav = re.compile(re.escape(data.scene) + r"-[0-9a-f]{12}")
    columns = (rows.texts("nav_id"), rows.texts("task_id"), rows.texts("modality"), rows.texts("reference_image_id"))
    for row, (own, task_id, modality, image) in enumerate(zip(*columns, strict=True)):
        if not nav.fullmatch(str(own)):
            yield Finding(row, f"nav_id = {own!r}", f"{data.scene}-<12 hexadecimal digits>")
        elif task_id != f"{own}-{str(modality)[:1]}":
            yield Finding(row, f"task_id = {task_id!r}", f"{own}-{str(modality)[:1]}")
        elif image is not None and not re.fullmatch(r"ref_[0-9a-f]{12}", image):
            yield Finding(row, f"reference_image_id = {image!r}", "ref_<12 hexadecimal digits>")


@check("tasks")
def telling_text(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Names and descriptions hold no coordinate and no node of the mesh."""
    nodes = {node for node in data["objects"].texts("mesh_node") if node and re.search(r"_\d+$", node)}
    names = ("target_name", "landmark", "description")
    judged: dict[str | None, str] = {None: ""}
    for name in names:
        for row, text in enumerate(rows.texts(name)):
            if text not in judged:
                leaked = next((w for w in re.split(r"[^A-Za-z0-9_]+", str(text)) if w in nodes), "")
                judged[text] = leaked or (m[0] if (m := _DECIMAL.search(str(text))) else "")
            if judged[text]:
                yield Finding(row, f"{name} tells {judged[text]!r}", "words alone")


@check("tasks")
def telling_number(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No number of a task's row is a coordinate of its goal or of its target, unless the start shares it."""
    goals = data["routes"].floats("goal_x_m", "goal_y_m", "goal_z_m").reshape(-1, 3)
    centres = data["objects"].floats("x_m", "y_m", "z_m").reshape(-1, 3)
    secret = np.hstack([at(goals, data.route_of_task), at(centres, data.target_of_task)])
    own, start = rows.floats(*START), at(data.paths.starts, data.route_of_task)
    alike = (np.abs(own[:, :, None] - secret[:, None, :]) <= _SAME_M).any(axis=2)
    leaked = alike & ~(np.abs(own - start) <= _SAME_M)
    for row in np.flatnonzero(leaked.any(axis=1)).tolist():
        k = int(leaked[row].argmax())
        yield Finding(row, f"{START[k]} = {own[row, k]:.9g}", "nothing of the goal")


@check("routes", after=("duplicate_key", "route_in_both_subsets"))
def duplicate_route(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A start anchor and a target make one navigation task."""
    pairs, nav_ids = rows.pairs(), rows.texts("nav_id")
    for row, first in repeated(pairs):
        yield Finding(row, f"start and target {pairs[row]} as {nav_ids[first]}", "each pair once")


@check("routes", after=("duplicate_key", "unknown_target", "unknown_start"))
def nav_id_guessed(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A nav_id is no hash of its start and target that anybody could compute."""
    for row, (pair, digits) in enumerate(zip(rows.pairs(), _digits(data, rows), strict=True)):
        if _guessed(data.scene, pair, digits):
            yield Finding(row, f"…-{digits}, a plain hash of the pair {pair}", "a hash with a key")


@check("objects")
def image_id_guessed(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture's id is no hash of its object that anybody could compute."""
    ids = zip(rows.ints("object_id").tolist(), rows.texts("mesh_node"), rows.texts("reference_image_id"), strict=True)
    for row, (object_id, node, image_id) in enumerate(ids):
        digits = str(image_id).removeprefix("ref_")
        if any(_guessed(data.scene, word, digits) for word in (str(object_id), str(node))):
            yield Finding(row, f"{image_id}, a plain hash of the object", "a hash with a key")


@check("routes", after=(*_OTHER_PAIR, "nav_id_guessed"))
def nav_id_of_salt(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A nav_id is what the pipeline's salt makes of its start and target."""
    key = key_of(data.pipeline.split.salt, data.pipeline.seed)
    yield from _unlike(rows.texts("nav_id"), [nav_id(data.scene, pair, key) for pair in rows.pairs()])


@check("objects", after=("image_id_guessed", "image_id_twice"))
def image_id_of_salt(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture's id is what the pipeline's salt makes of its object."""
    key = key_of(data.pipeline.split.salt, data.pipeline.seed)
    expected = [reference_id(data.scene, k, key) for k in rows.ints("object_id").tolist()]
    yield from _unlike(rows.texts("reference_image_id"), expected)


@check("routes", after=("duplicate_key", "unknown_target", "nav_id_guessed", "nav_id_of_salt"))
def telling_digits(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Digits and order of nav_ids are independent of target, start, landmark, direction, category and length."""
    fit = np.flatnonzero(rows.judged)
    digits = np.array(_digits(data, rows))[fit].tolist()
    if len(fit) < _FEW:
        raise UncheckedError(f"fewer than {_FEW} ids")
    objects, target = data["objects"], data.target_of_route[fit]
    length = rows.floats("length_m")[fit]
    secrets = {
        **{name: _codes(rows.texts(name)[fit]) for name in ("target_object_id", "start_object_id")},
        **{name: _codes(objects.texts(name)[target]) for name in ("landmark_id", "direction", "category")},
        "setting": _codes(rows.texts("setting")[fit]),
        "length_m": np.searchsorted(np.quantile(length, np.linspace(0, 1, _LENGTH_BINS + 1)[1:-1]), length),
    }
    order = np.argsort(np.array(digits), kind="stable")
    backwards = np.argsort(np.array([text[::-1] for text in digits]), kind="stable")
    parts = {f"digit {k + 1}": _codes([text[k : k + 1] for text in digits]) for k in range(_DIGITS)}
    parts |= {f"digits {k + 1} and {k + 2}": _codes([text[k : k + 2] for text in digits]) for k in (0, _DIGITS - 2)}
    tests = {words: partial(_shared, part) for words, part in parts.items()}
    tests |= {"order": partial(_neighbours, order), "order from the end": partial(_neighbours, backwards)}
    for name, secret in secrets.items():
        for words, statistic in tests.items():
            rng = generator(0, "validate", data.scene, name, words)
            drawn = [statistic(secret[rng.permutation(len(secret))]) for _ in range(_DRAWINGS)]
            # Counts that hardly vary by chance are given the deviation of a count.
            deviation = max(float(np.std(drawn)), float(np.sqrt(np.mean(drawn))), 1.0)
            off = (statistic(secret) - float(np.mean(drawn))) / deviation
            if off > _DEVIATIONS:
                found = f"nav_ids whose {words} goes with {name}, {off:.0f} standard deviations above chance"
                yield Finding(int(fit[0]), found, f"{_DEVIATIONS:g} at most, as of digits that were drawn")
                break


def _digits(data: SceneData, rows: Rows) -> list[str]:
    return [str(text).removeprefix(f"{data.scene}-") for text in rows.texts("nav_id")]


def _guessed(scene: str, name: str, digits: str) -> bool:
    texts = (f"{scene}/{name}", name, f"{scene}-{name}", f"{scene}_{name}")
    return any(make(text.encode()) == digits for text in texts for make in _HASHES)


def _unlike(ids: Texts, expected: Sequence[str]) -> Iterator[Finding]:
    off = [row for row, (own, made) in enumerate(zip(ids, expected, strict=True)) if own != made]
    if 2 * len(off) > len(ids):
        raise UncheckedError("the release was made with another salt than the pipeline's")
    # An id of another form is told by `telling_id`.
    for row in (row for row in off if re.search(r"[-_][0-9a-f]{12}$", str(ids[row]))):
        yield Finding(row, str(ids[row]), expected[row])


def _codes(values: Iterable[object]) -> Ints:
    """Number the values, equal ones alike, (n,) int64."""
    known: dict[object, int] = {}
    return np.array([known.setdefault(value, len(known)) for value in values], dtype=np.int64)


def _shared(part: Ints, secret: Ints) -> float:
    """Pairs of rows that share both a part of their ids and a secret."""
    cells = np.bincount(part * (int(secret.max(initial=0)) + 1) + secret).astype(np.float64)
    return float((cells * (cells - 1)).sum() / 2)


def _neighbours(order: Ints, secret: Ints) -> float:
    """Ids next to each other in their order that share a secret."""
    return float((np.diff(secret[order]) == 0).sum())
