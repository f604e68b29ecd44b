"""A real S3 server on loopback, a proxy before it that answers with faults, and files in data roots."""

from __future__ import annotations

import contextlib
import functools
import re
import shutil
import socket
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

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
    yield "http://{}:{}".format(*server.get_host_and_port())
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
        self._to = int(server.rpartition(":")[2])
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        self._rules: list[list] = []
        self.seen: list[str] = []
        self._lock = threading.Lock()
        threading.Thread(target=self._serve, daemon=True).start()

    def fail(self, pattern: str, how: int | str | float, times: int = 1) -> None:
        """Let requests whose first line matches fail."""
        with self._lock:
            self._rules.append([re.compile(pattern), how, times])

    def left(self) -> int:
        """How many faults have not happened."""
        return sum(rule[2] for rule in self._rules)

    def close(self) -> None:
        self._listener.close()

    def _serve(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._client, args=(client,), daemon=True).start()

    def _client(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError), client:
            while self._request(client):
                pass

    def _request(self, client: socket.socket) -> bool:
        head = _head(client)
        if not head:
            return False
        line = head.split(b"\r\n", 1)[0].decode()
        self.seen.append(line)
        how = self._rule(line)
        if how == "drop":
            if not line.startswith(("GET", "DELETE", "HEAD")):
                client.recv(1000)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            return False
        if b"100-continue" in head.lower():
            client.sendall(b"HTTP/1.1 100 Continue\r\n\r\n")
            head = re.sub(rb"(?i)\r\nexpect:[^\r]*", b"", head)
        length = int((re.search(rb"(?i)\r\ncontent-length: *(\d+)", head) or [0, 0])[1])
        body = _exactly(client, length)
        if isinstance(how, int):
            code = {500: "InternalError", 503: "SlowDown"}[how]
            text = f"<Error><Code>{code}</Code><Message>{code}</Message></Error>".encode()
            client.sendall(b"HTTP/1.1 %d X\r\nContent-Type: application/xml\r\nContent-Length: %d\r\n\r\n%s"
                           % (how, len(text), text))  # fmt: skip
            return True
        if isinstance(how, float):
            time.sleep(how)
        head = re.sub(rb"(?i)\r\nconnection:[^\r]*", b"", head).replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n")
        with socket.create_connection(("127.0.0.1", self._to)) as server:
            server.sendall(head + body)
            answer = b""
            while block := server.recv(1 << 16):
                answer += block
        if how in ("cut", "stall"):
            answer = answer[: answer.index(b"\r\n\r\n") + 4 + len(answer) // 3]
        client.sendall(answer)
        if how == "stall":
            client.recv(1)  # until the other side gives up
        return False

    def _rule(self, line: str) -> int | str | float | None:
        with self._lock:
            for rule in self._rules:
                if rule[2] and rule[0].search(line):
                    rule[2] -= 1
                    return rule[1]
        return None


def _head(client: socket.socket) -> bytes:
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        byte = client.recv(1)
        if not byte:
            return b""
        head += byte
    return head


def _exactly(client: socket.socket, length: int) -> bytes:
    body = b""
    while len(body) < length:
        block = client.recv(min(1 << 16, length - len(body)))
        if not block:
            break
        body += block
    return body


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
