"""Data roots of both kinds: a directory, and a prefix on a real S3 server."""

from __future__ import annotations

import os
import urllib.request
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.s3_server import CREDENTIALS, Proxy, forget_clients, s3_server

from aerialdojo_gen.store.root import DataRoot, open_root


@pytest.fixture(scope="session")
def server() -> Iterator[str]:
    with s3_server() as url:
        yield url


@pytest.fixture
def cloud(server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An empty bucket, the environment to reach it with, and a cache of its own; yields ``s3://bucket/prefix``."""
    name = f"b-{uuid.uuid4().hex[:12]}"
    for key in [key for key in os.environ if key.startswith("AWS_")]:
        monkeypatch.delenv(key)
    for key, value in CREDENTIALS.items():
        monkeypatch.setenv(key, value)
    monkeypatch.setenv("AWS_ENDPOINT_URL", server)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AERIALDOJO_CACHE", str(tmp_path / "cache"))
    urllib.request.urlopen(urllib.request.Request(f"{server}/{name}", method="PUT")).close()
    forget_clients()
    yield f"s3://{name}/data"
    forget_clients()


@pytest.fixture
def proxy(cloud: str, server: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Proxy]:
    """What stands before the server from now on, for this process and those that it starts."""
    made = Proxy(server)
    monkeypatch.setenv("AWS_ENDPOINT_URL", made.url)
    forget_clients()
    yield made
    made.close()


@pytest.fixture(params=["directory", "s3"])
def root(request: pytest.FixtureRequest, tmp_path: Path) -> DataRoot:
    if request.param == "directory":
        return open_root(tmp_path / "data")
    return open_root(str(request.getfixturevalue("cloud")))
