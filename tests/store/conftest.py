"""Data roots of both kinds: a directory, and a prefix on a real S3 server."""

from __future__ import annotations

import os
import urllib.request
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.s3_server import CREDENTIALS, Proxy, forget_clients, s3_server, upload

from aerialdojo_gen.store.root import DataRoot, open_root


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of the test's own."""
    monkeypatch.setenv("AERIALDOJO_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture(scope="session")
def server() -> Iterator[str]:
    with s3_server() as url:
        yield url


def new_bucket(server: str) -> str:
    """Make an empty bucket; gives ``s3://bucket/prefix``."""
    name = f"b-{uuid.uuid4().hex[:12]}"
    urllib.request.urlopen(urllib.request.Request(f"{server}/{name}", method="PUT")).close()
    return f"s3://{name}/data"


def reach(server: str, cache: Path, patch: pytest.MonkeyPatch) -> None:
    """Set the environment to reach the server with, and a cache of its own."""
    for key in [key for key in os.environ if key.startswith("AWS_")]:
        patch.delenv(key)
    for key, value in CREDENTIALS.items():
        patch.setenv(key, value)
    patch.setenv("AWS_ENDPOINT_URL", server)
    patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    patch.setenv("AERIALDOJO_CACHE", str(cache))
    forget_clients()


@pytest.fixture
def cloud(server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An empty bucket, the environment to reach it with, and a cache of its own; yields ``s3://bucket/prefix``."""
    reach(server, tmp_path / "cache", monkeypatch)
    yield new_bucket(server)
    forget_clients()


@pytest.fixture(scope="session")
def smoke_bucket(server: str, smoke: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The smoke run's release and meshes, and what filter kept, in a bucket."""
    cloud = new_bucket(server)
    with pytest.MonkeyPatch.context() as patch:
        reach(server, tmp_path_factory.mktemp("cache"), patch)
        upload(open_root(cloud), smoke, ("release", "meshes", "plans", "verdicts"))
    return cloud


@pytest.fixture
def uploaded(server: str, smoke_bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """`smoke_bucket`, and the environment to reach it with: what a test writes there it removes, or calls its own."""
    reach(server, tmp_path / "cache", monkeypatch)
    yield smoke_bucket
    forget_clients()


@pytest.fixture
def configure(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """A function that sets variables of the environment, for clients that are made from then on."""

    def set_all(**variables: object) -> None:
        for name, value in variables.items():
            monkeypatch.setenv(name, str(value))
        forget_clients()

    return set_all


@pytest.fixture
def proxy(cloud: str, server: str, configure: Callable[..., None]) -> Iterator[Proxy]:
    """What stands before the server from now on, for this process and those that it starts."""
    made = Proxy(server)
    configure(AWS_ENDPOINT_URL=made.url)
    yield made
    made.close()


@pytest.fixture(params=["directory", "s3"])
def root(request: pytest.FixtureRequest, tmp_path: Path) -> DataRoot:
    if request.param == "directory":
        return open_root(tmp_path / "data")
    return open_root(str(request.getfixturevalue("cloud")))
