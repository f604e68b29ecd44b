"""A release to and from the Hugging Face Hub, or a server that answers as it does: its own files alone.

Each file is held against its digest, and what goes wrong is told in one line.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import re
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from aerialdojo_gen.base import errors as base_errors
from aerialdojo_gen.base.errors import AerialDojoError, StoreError, UsageError, brief
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.dataset.contents import FOLDER, SHARDS, check_release, existing_scenes, part_name
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import atomic_folder, make_folder
from aerialdojo_gen.store.files import sha256_of
from aerialdojo_gen.store.layout import is_plain
from aerialdojo_gen.store.root import DataRoot, LocalRoot, Where, open_root

TOKEN, ENDPOINT, USUAL = "HF_TOKEN", "HF_ENDPOINT", "https://huggingface.co"
_REPO = re.compile(r"[A-Za-z0-9][\w.-]{0,95}/[A-Za-z0-9][\w.-]{0,95}")
_REVISION = re.compile(r"[\w.][\w./-]{0,199}")


def check_revision(revision: str | None) -> None:
    """Refuse what cannot be a revision, before anything is read or sent."""
    if revision is not None and (not _REVISION.fullmatch(revision) or ".." in revision):
        raise UsageError(f"{brief(revision, 100)!r} is no branch, tag or commit")


class Hub:
    """A data set on the Hub."""

    def __init__(self, repo: str, verb: str, revision: str | None, *, writes: bool = False) -> None:
        check_revision(revision)
        if not _REPO.fullmatch(repo) or ".." in repo or repo.endswith(".git"):
            raise UsageError(f"{brief(repo, 100)!r} is no data set's name: write USER/NAME")
        self.repo = repo
        self.endpoint = os.environ.get(ENDPOINT, "").strip().rstrip("/") or USUAL
        # As messages say it: an address may have a password in it.
        self.address = Secrets().text(self.endpoint)
        if not re.match(r"https?://[^\s/]", self.endpoint):
            raise UsageError(f"{ENDPOINT}={brief(self.address, 100)!r} is no address: write https://…")
        self.token: str | bool = os.environ.get(TOKEN, "").strip() or False
        parts = urlsplit(self.endpoint)
        # Not by HTTPS, and to another machine: what is sent can be read on the way.
        is_open = parts.scheme != "https" and parts.hostname not in ("127.0.0.1", "::1", "localhost")
        if self.token and is_open:
            raise UsageError(
                f"{TOKEN} would go to {self.address} unencrypted: write {ENDPOINT}=https://…, or unset {TOKEN} "
                "to read what is public"
            )
        if writes and not self.token:
            raise AerialDojoError(
                f"{verb} needs a token that may write: export {TOKEN}=hf_…, made at {self.address}/settings/tokens"
            )
        try:
            import huggingface_hub
            from huggingface_hub.utils import disable_progress_bars  # type: ignore[attr-defined]
        except ImportError:
            raise base_errors.MissingPackage(base_errors.no_package(verb, "huggingface_hub", "hub")) from None
        disable_progress_bars()
        self.api: Any = huggingface_hub.HfApi(endpoint=self.endpoint, token=self.token, library_name="aerialdojo-gen")

    @contextmanager
    def explain_errors(self, doing: str) -> Iterator[None]:
        """Turn what the server or the network answers into a line."""
        from huggingface_hub import errors

        # The library's own client: its name is another one in other versions.
        known = (errors.HfHubHTTPError.__bases__[0], ConnectionError, TimeoutError)
        try:
            yield
        except Exception as error:
            # What goes wrong in one of its threads comes as a RuntimeError that was caused by it.
            cause: BaseException | None = error
            while cause is not None and not isinstance(cause, known):
                cause = cause.__cause__
            if cause is None or isinstance(error, AerialDojoError):
                raise
            raise self._explain(cause, doing) from None

    def _explain(self, error: BaseException, doing: str) -> AerialDojoError:
        from huggingface_hub import errors

        who = f"{TOKEN} may not see it" if self.token else f"it is private, and {TOKEN} is not set"
        if isinstance(error, errors.RevisionNotFoundError):
            return UsageError(f"{self.repo} at {self.address} has no such revision")
        if not isinstance(error, errors.HfHubHTTPError):
            return AerialDojoError(
                f"cannot reach {self.address} ({self._line(error)}): the same command goes on when there is a way"
            )
        status = error.response.status_code if error.response is not None else 0
        # Without an account the server says of what is private, and of what is not there, 401.
        if status == 404 or (status == 401 and isinstance(error, errors.RepositoryNotFoundError)):
            return UsageError(f"there is no data set {self.repo} at {self.address}, or {who}")
        if status == 401:
            return AerialDojoError(f"{self.address} does not know the token in {TOKEN}: make another")
        if status == 403:
            return AerialDojoError(
                f"{self.address} refuses to {doing} {self.repo} ({self._line(error)}): {TOKEN} needs that right"
            )
        return AerialDojoError(f"{self.address} answers {status}: {self._line(error)}; try again later")

    def _line(self, error: BaseException) -> str:
        message = getattr(error, "server_message", None)
        return Secrets().text(brief(str(message), 160) if message else base_errors.first_line(error))


# What stands beside the tables; the dataset card is what the Hub shows of a data set.
_COMPANIONS = ("README.md", "croissant.json", "pipeline.json", "protocol.json")
_AT_ONCE = 8


@dataclass(frozen=True)
class Moved:
    """What was sent or fetched."""

    where: str  # The data set's address, or the folder
    commit: str  # The revision, hexadecimal
    scenes: int
    files: int
    bytes: int
    meshes: int = 0  # How many of the files are meshes
    left: tuple[str, ...] = ()  # What the data set holds beside a release, and was left there

    def __str__(self) -> str:
        """Where, and how much."""
        return (
            f"{self.where}: {self.scenes:,} scenes, {self.files:,} files, {self.bytes / 1e6:,.1f} MB, "
            f"revision {self.commit[:12]}"
        )


def push_to_hub(
    repo: str,
    data: Where = "data",
    *,
    private: bool = False,
    revision: str | None = None,
    meshes: bool = False,
    policies: Sequence[str] = (),
    reporter: Reporter | None = None,
) -> Moved:
    """Send a release to the Hub as a data set; the twin of ``aerialdojo-gen push-to-hub``.

    One commit holds it all. Files that the server has are not sent again, so that the same call goes on after a
    failure; parts of scenes that the release does not have (any more) are removed there.

    Parameters
    ----------
    repo : str
        ``USER/NAME``; made where there is none.
    data : str, Path or DataRoot
        The data directory, on this machine.
    private : bool
        Whether a data set that is made now is private.
    revision : str, optional
        Branch to write to; the main one where absent.
    meshes : bool
        Send the scenes' meshes too: `evaluate`, `view` and the whole of `validate` want them.
    policies : sequence of str
        Names of trainings whose last weights are sent too, such as ``imitation``.
    reporter : Reporter, optional
        Reports what is done.

    Raises
    ------
    UsageError
        The name is none, or the data directory is no folder of this machine.
    StoreError
        There is no release, or a part of it is missing or damaged.
    AerialDojoError
        There is no token in ``HF_TOKEN``, it may not write, or the server does not answer.
    """
    root = open_root(data)
    if not isinstance(root, LocalRoot):
        raise UsageError("push-to-hub sends a folder of this machine: copy the release here and name it with --data")
    check_revision(revision)
    scenes = check_release(root)
    reporter = reporter or Reporter(quiet=True)
    hub = Hub(repo, "push-to-hub", revision, writes=True)
    from huggingface_hub import CommitOperationAdd, CommitOperationDelete

    own = [*_COMPANIONS, *(part_name(key, scene, "") for key in SHARDS for scene in scenes)]
    files = {name: root.path / FOLDER / name for name in own if (root.path / FOLDER / name).is_file()}
    for scene in scenes if meshes else ():
        path = files[f"meshes/{scene}.glb"] = root.path / "meshes" / f"{scene}.glb"
        if not path.is_file():
            raise StoreError(f"the mesh {path} is missing: leave --meshes out, or make it by build-scenes")
    for policy in policies:
        path = files[_policy_file(policy)] = root.path / _policy_file(policy)
        if not is_plain(policy) or not path.is_file():
            known = root.path / "policies"
            raise UsageError(f"there are no weights {path}: --policy takes the name of a training in {known}")
    size = sum(path.stat().st_size for path in files.values())
    reporter.line(f"push-to-hub: {len(files):,} files, {size / 1e6:,.1f} MB to {hub.address}/datasets/{repo}")
    with hub.explain_errors("make or write to"):
        if not hub.api.repo_exists(repo, repo_type="dataset"):
            hub.api.create_repo(repo, repo_type="dataset", private=private)
        if revision:
            hub.api.create_branch(repo, branch=revision, repo_type="dataset", exist_ok=True)
        there = hub.api.list_repo_files(repo, repo_type="dataset", revision=revision)
        gone = [name for name in there if scene_of(name) and name not in files and (meshes or not _is_mesh(name))]
        operations: list[Any] = [CommitOperationAdd(name, str(path)) for name, path in sorted(files.items())]
        operations += [CommitOperationDelete(name) for name in sorted(gone)]
        made = hub.api.create_commit(
            repo, operations, commit_message=f"Release of {len(scenes)} scenes", repo_type="dataset",
            revision=revision, num_threads=_AT_ONCE,
        )  # fmt: skip
    where = f"{hub.address}/datasets/{repo}"
    return Moved(where, str(made.oid), len(scenes), len(files), size, sum(map(_is_mesh, files)))


def pull_release(
    repo: str,
    data: Where = "data",
    *,
    revision: str | None = None,
    meshes: bool = True,
    replace: bool = False,
    reporter: Reporter | None = None,
) -> Moved:
    """Fetch a release from the Hub; the twin of ``aerialdojo-gen pull``.

    Only files that a release has are fetched, by the names that they have here, and the weights of policies. What was
    fetched stays after a failure, and the same call goes on from there. Each file is held against the digest that the
    server has of it, and all parts against their own; then the release appears whole.

    Parameters
    ----------
    repo : str
        ``USER/NAME``.
    data : str, Path or DataRoot
        Data directory to be made, or one without a release, on this machine.
    revision : str, optional
        Branch, tag or commit; the main branch where absent.
    meshes : bool
        Fetch the meshes too, where the data set has them.
    replace : bool
        Whether a release, meshes and weights that are there may be lost.
    reporter : Reporter, optional
        Shows progress.

    Raises
    ------
    UsageError
        There is no such data set or revision, it holds no release, or the data directory has another one, or other
        meshes of its scenes, or other weights.
    StoreError
        What came is damaged, or the disk is full.
    AerialDojoError
        The server does not answer.
    """
    root = open_root(data)
    if not isinstance(root, LocalRoot):
        raise UsageError("pull writes a folder of this machine: name one with --data")
    if root.path.exists() and not root.path.is_dir():
        raise StoreError(f"{root.path} is no folder: name another with --data")
    if existing_scenes(root) and not replace:
        raise UsageError(f"there is a release in {root.url}: name another folder with --data, or add --replace")
    reporter = reporter or Reporter(quiet=True)
    hub = Hub(repo, "pull", revision)
    with hub.explain_errors("read"):
        info = hub.api.repo_info(repo, repo_type="dataset", revision=revision, files_metadata=True)
    commit = str(info.sha)
    ours = {place: file for file in info.siblings if (place := place_of(file.rfilename))}
    chosen = {place: file for place, file in ours.items() if meshes or not _is_mesh(place)}
    names = [file.rfilename for file in info.siblings]
    left = tuple(name for name in names if not place_of(name) and name != ".gitattributes")
    scenes = {scene_of(file.rfilename) for place, file in chosen.items() if not _is_companion(place)} - {""}
    if not scenes:
        raise UsageError(f"the data set {repo} at {hub.address} holds no release of aerialdojo-gen")
    if not replace:
        _check_replaced(root, chosen, repo)
    # Laid out as a data directory, so that what is asked of one can be asked of it.
    partial = root.path / f".pull-{repo.replace('/', '--')}"
    make_folder(partial / FOLDER)
    # What a call for another revision has left is no part of this one.
    for path in partial.rglob("part-*.parquet"):
        if path.relative_to(partial).as_posix() not in chosen:
            path.unlink()
    _fetch(hub, commit, chosen, partial, reporter)
    size = sum((partial / place).stat().st_size for place in chosen)
    _verify(open_root(partial), chosen)
    _move_into_place(root, partial, sorted(chosen))
    return Moved(str(root.path / FOLDER), commit, len(scenes), len(chosen), size, sum(map(_is_mesh, chosen)), left)


def scene_of(name: str) -> str:
    """Return the scene that a file of a data set is a part or the mesh of; empty where it is neither."""
    stem = PurePosixPath(name).name.partition(".")[0].removeprefix("part-")
    if not is_plain(stem):
        return ""
    own = {f"meshes/{stem}.glb", *(part_name(key, stem, "") for key in SHARDS)}
    return stem if name in own else ""


def _is_mesh(name: str) -> bool:
    return name.startswith("meshes/")


def _policy_file(name: str) -> str:
    return f"policies/{name}/policy.safetensors"


def place_of(name: str) -> str:
    """Return where a file lies in a data directory, meshes and weights beside the release; empty for a stranger's."""
    training = PurePosixPath(name).parent.name
    if (_is_mesh(name) and scene_of(name)) or (is_plain(training) and name == _policy_file(training)):
        return name
    return f"{FOLDER}/{name}" if name in _COMPANIONS or scene_of(name) else ""


def _is_companion(place: str) -> bool:
    return not place.startswith(f"{FOLDER}/")


def _check_replaced(root: LocalRoot, chosen: Mapping[str, Any], repo: str) -> None:
    """Refuse to take the place of other meshes or weights: without a release they may be all that somebody has."""
    others = [name for name in filter(_is_companion, sorted(chosen)) if (root.path / name).is_file()]
    others = [name for name in others if not _matches_server(root.path / name, chosen[name])]
    if others:
        more = f" and {len(others) - 1} more" if others[1:] else ""
        raise UsageError(
            f"{root.at(others[0])}{more} would be replaced by {repo}'s: name another folder with --data, or add "
            f"{'--no-meshes or ' * _is_mesh(others[0])}--replace"
        )


def _fetch(hub: Hub, commit: str, files: Mapping[str, Any], folder: Path, reporter: Reporter) -> None:
    """Fetch what is not there yet, and hold each file against what the server says of it."""

    def one(place: str, sibling: Any) -> None:
        path, name = folder / place, sibling.rfilename
        if path.is_file() and _matches_server(path, sibling):
            return
        below = path.parents[len(PurePosixPath(name).parts) - 1]
        hub.api.hf_hub_download(hub.repo, name, repo_type="dataset", revision=commit, local_dir=below)
        if not _matches_server(path, sibling):
            path.unlink(missing_ok=True)
            raise StoreError(f"{name} of {hub.repo} was damaged in transfer: the same command fetches it again")

    with reporter.bar("pull", len(files), "files") as bar, hub.explain_errors("read"):
        pool = ThreadPoolExecutor(_AT_ONCE)
        try:
            for done in as_completed([pool.submit(one, *item) for item in files.items()]):
                done.result()
                bar.advance()
        finally:
            pool.shutdown(cancel_futures=True)


def _matches_server(path: Path, sibling: Any) -> bool:
    """Whether a file has the size and the digest that the server has: SHA-256 of a large one, else git's own."""
    size = path.stat().st_size
    if sibling.size is not None and size != sibling.size:
        return False
    if sibling.lfs is not None:
        return bool(sha256_of(path) == sibling.lfs.sha256)
    digest = hashlib.sha1(b"blob %d\0" % size, usedforsecurity=False)
    with path.open("rb") as file:
        hashlib.file_digest(file, lambda: digest)
    return bool(digest.hexdigest() == sibling.blob_id)


def _verify(root: DataRoot, fetched: Collection[str]) -> None:
    """Read every part, which verifies its columns, and hold meshes against what the release says of them."""
    for scene in check_release(root):
        for key in SHARDS:
            store.read_scene(root, key, scene)
        row = store.read_scene(root, "release/scenes", scene, ("mesh_path", "mesh_sha256")).to_pylist()[0]
        name = row["mesh_path"]
        if name in fetched and root.digest(name) != row["mesh_sha256"]:
            raise StoreError(f"{root.at(name)} is not the mesh that the release was made from: pull --no-meshes")


def _move_into_place(root: LocalRoot, partial: Path, places: Sequence[str]) -> None:
    """Give the fetched files their places: the release in one step, what lies beside it before."""
    for place in filter(_is_companion, places):
        with root.commit(place) as temporary:
            (partial / place).replace(temporary)
    with root.lock(), atomic_folder(root.path / FOLDER) as folder:
        for place in itertools.filterfalse(_is_companion, places):
            target = folder / place.removeprefix(f"{FOLDER}/")
            make_folder(target.parent)
            (partial / place).replace(target)
    shutil.rmtree(partial, ignore_errors=True)
