"""A real S3 server on loopback, a proxy before it that answers with faults, and files in data roots."""

from __future__ import annotations

import contextlib
import functools
import http.client
import re
import shutil
import socket
import threading
import time
from collections.abc import Iterable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import botocore.session

from aerialdojo_gen.store import bucket, object_folders
from aerialdojo_gen.store.root import DataRoot

# The description of the service, which each client would read anew for 0.2 s, is read once.
botocore.session.create_loader = functools.cache(botocore.session.create_loader)

CREDENTIALS = {"AWS_ACCESS_KEY_ID": "testing", "AWS_SECRET_ACCESS_KEY": "testing", "AWS_DEFAULT_REGION": "us-east-1"}


def forget_clients() -> None:
    """Let the next request of this process read the environment anew."""
    bucket._made_client.cache_clear()
    object_folders._made.cache_clear()


@contextlib.contextmanager
def s3_server() -> Iterator[str]:
    """Run moto's server in threads of this process; yields its URL."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    try:
        yield "http://{}:{}".format(*server.get_host_and_port())
    finally:
        server.stop()


def upload(root: DataRoot, data: Path, folders: Iterable[str]) -> None:
    """Put all files of some folders of a data directory to their places in a bucket."""
    for path in sorted(path for folder in folders for path in (data / folder).rglob("*") if path.is_file()):
        with root.commit(path.relative_to(data).as_posix()) as copy:
            shutil.copyfile(path, copy)


class Proxy:
    """Hands requests on to a server, but for those that match a rule: each rule is used up by its number of times.

    Rules are added by `fail`: a number is answered as an HTTP error, ``"drop"`` closes the connection after part of
    the request was taken, ``"cut"`` closes it in the middle of the answer, ``"stall"`` sends nothing more from there
    on, a float waits for so many seconds.
    """

    def __init__(self, server: str) -> None:
        self._to = server.removeprefix("http://")
        self._rules: list[list] = []
        self.seen: list[str] = []
        self._lock = threading.Lock()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Handler, self))
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def fail(self, pattern: str, how: int | str | float, times: int = 1) -> None:
        """Let requests whose first line matches fail."""
        with self._lock:
            self._rules.append([re.compile(pattern), how, times])

    def left(self) -> int:
        """How many faults have not happened."""
        return sum(rule[2] for rule in self._rules)

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()

    def fault_of(self, line: str) -> int | str | float | None:
        with self._lock:
            self.seen.append(line)
            for rule in self._rules:
                if rule[2] and rule[0].search(line):
                    rule[2] -= 1
                    return rule[1]
        return None

    def forward(self, method: str, path: str, body: bytes, headers: dict[str, str]) -> tuple[int, list, bytes]:
        with contextlib.closing(http.client.HTTPConnection(self._to, timeout=60)) as server:
            server.request(method, path, body, headers)
            answer = server.getresponse()
            return answer.status, answer.getheaders(), answer.read()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def __init__(self, proxy: Proxy, *connection: Any) -> None:
        self._proxy = proxy
        with contextlib.suppress(OSError):
            super().__init__(*connection)

    def log_message(self, *arguments: Any) -> None:
        """Say nothing on stderr."""

    def _handle(self) -> None:
        how = self._proxy.fault_of(self.requestline)
        if how == "drop":
            if self.command in ("PUT", "POST"):
                self.rfile.read1(1000)
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            self.connection.close()
            raise OSError("dropped")
        body = self.rfile.read(int(self.headers["content-length"] or 0))
        if isinstance(how, int):
            code = {500: "InternalError", 503: "SlowDown"}[how]
            answer = f"<Error><Code>{code}</Code><Message>{code}</Message></Error>".encode()
            status, headers = how, [("Content-Length", str(len(answer)))]
        else:
            time.sleep(how if isinstance(how, float) else 0)
            kept = {
                name: value for name, value in self.headers.items() if name.lower() not in ("connection", "expect")
            }
            status, headers, answer = self._proxy.forward(self.command, self.path, body, kept)
        self.send_response_only(status)
        for name, value in headers:
            self.send_header(name, value)
        self.end_headers()
        broken = how in ("cut", "stall")
        self.wfile.write(answer[: len(answer) // 3] if broken else answer)
        if how == "stall":
            self.connection.recv(1)  # until the other side gives up
        self.close_connection = self.close_connection or broken

    do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = _handle  # noqa: N815 - as the server calls them


def write(root: DataRoot, name: str, data: bytes) -> None:
    with root.commit(name) as path:
        path.write_bytes(data)


def fill(root: DataRoot, folder: str, files: dict[str, bytes]) -> None:
    with root.commit_folder(folder) as path:
        for name, data in files.items():
            (path / name).parent.mkdir(exist_ok=True)
            (path / name).write_bytes(data)


def read_folder(root: DataRoot, folder: str) -> dict[str, bytes]:
    here = root.local_copy(folder)
    return {p.relative_to(here).as_posix(): p.read_bytes() for p in here.rglob("*") if p.is_file()}
