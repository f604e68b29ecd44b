"""The pages' servers, as started by their commands, against clients that mean no good or send no sense."""

import contextlib
import http.client
import json
import resource
import socket
import sys
import time
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

import pytest
from support.browser import until
from support.command_line import called
from support.pages import YARD, serving, yard_in

from aerialdojo_gen.studio.web.limits import MAX_PER_CLIENT

pytestmark = pytest.mark.slow


class Server(NamedTuple):
    port: int
    cookie: str = ""

    def send(self, method, path, body=None, headers=None, source="127.0.0.1"):
        """Send a request as it is, from one of this machine's addresses; gives the answer and its text."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60, source_address=(source, 0))
        with contextlib.closing(connection):
            connection.request(method, path, body, {"Cookie": self.cookie} | (headers or {}))
            answer = connection.getresponse()
            return answer, answer.read().decode("utf-8", "replace")

    def ask(self, *request):
        answer, text = self.send(*request)
        return answer.status, text

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=30)

    def serves(self, source="127.0.0.1"):
        return self.send("GET", "/", source=source)[0].status == 200


IMPATIENT = """
from aerialdojo_gen.cli.app import main
from aerialdojo_gen.studio.web import limits

limits.HEAD_S = 2.0
main()
"""


class Desk(NamedTuple):
    server: Server
    token: str
    annotations: Path
    log: Path


@pytest.fixture(scope="module")
def started(project, tmp_path_factory):
    """``annotate --host 0.0.0.0`` with few files to open, as macOS gives.

    It waits 2 s in place of 10 s for the rest of a request's head.
    """
    folder = tmp_path_factory.mktemp("hostile")
    place, log = yard_in(project, folder), folder / "log.txt"

    def few_files():
        resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))

    asked = (*place.command, "--host", "0.0.0.0")
    with (
        log.open("wb") as file,
        serving(*asked, program=("-c", IMPATIENT), stderr=file, preexec_fn=few_files) as page,
    ):
        token = page.url.partition("?token=")[2]
        yield Desk(Server(urlsplit(page.url).port, f"aerialdojo-annotate={token}"), token, place.annotations, log)
        assert page.process.poll() is None


@pytest.fixture
def desk(started):
    """That server; nothing changes its annotations, or fills its log."""
    before = started.annotations.read_bytes()
    yield started
    assert started.annotations.read_bytes() == before
    assert started.log.stat().st_size < 20_000, started.log.read_text()[:3000]


# ---- requests without sense ----

DEEP, DIGITS, HALF = b"[" * 100_000, b"9" * 5000, b'"\\ud800"'
VALUES = [
    b"null", b"true", b"-1", b"1e999", b"NaN", b"-Infinity", DIGITS, b'""', HALF, b'"\\u0000"', b"[]", b"{}",
    b'{"\\ud800": 1}', b'"' + b"x" * 5000 + b'"', DEEP, b"[NaN, 1e999, " + DIGITS + b"]",
    b"[1.0, 2.0, " + HALF + b"]",
]  # fmt: skip
AUTHOR = b'"who": %(who)s, "client": %(client)s'
BODIES = {
    "/api/operations": b"{" + AUTHOR + b', "operation": {"do": %(do)s, "kind": %(kind)s, "id": %(id)s, '
    b'"fields": {"name": %(name)s, "anchor": %(anchor)s}}}',
    "/api/draft": b'{"operation": {"do": "change", "kind": %(kind)s, "id": %(id)s, "fields": {"name": %(name)s}}}',
    "/api/undo": b"{" + AUTHOR + b"}",
    "/api/redo": b"{" + AUTHOR + b"}",
    "/api/import": b"{" + AUTHOR + b', "text": %(text)s}',
    "/api/pick": b'{"origin_m": %(triple)s, "direction": %(other)s}',
    "/api/boxes": b'{"low_m": %(triple)s, "high_m": %(other)s, "category": %(name)s}',
    # Of an object that is not there: nothing is computed for a body that makes sense.
    "/api/objects/9999/viewpoint": b'{"position_m": %(triple)s, "yaw_deg": %(id)s, "snap": %(flag)s}',
}
GOOD = {
    b"who": b'"Ada"', b"client": b'"hostile"', b"do": b'"change"', b"kind": b'"objects"', b"id": b"0",
    b"name": b'"red delivery van"', b"anchor": b"null", b"text": b'""', b"triple": b"[0.0, 0.0, 900.0]",
    b"other": b"[0.0, 0.0, 0.0]", b"flag": b"false",
}  # fmt: skip
# An empty name is one that somebody may be about to type anew.
SENSIBLE = {(b"name", b'""')}


def refused(status, text):
    """A refusal in one line, fit to be shown."""
    assert 400 <= status < 500, (status, text[:300])
    line = json.loads(text)["error"] if text.startswith("{") else text
    assert line
    assert line.isprintable(), line
    assert len(line) <= 500
    return True


def hostile_bodies(template):
    """Bodies, and whether they are malformed whatever the address takes."""
    keys = [key for key in GOOD if b"%(" + key + b")s" in template]
    wrong = [(key, value) for key in keys for value in VALUES if (key, value) not in SENSIBLE]
    yield from ((template % (GOOD | {key: value}), False) for key, value in wrong)
    whole = template % GOOD
    more = whole[:-1] + b', "more": 1}'
    broken = (b"", b"{", b"null", whole[:-1], b"\xff" + whole, whole + b"x", more, b"[" + whole + b"]", DEEP)
    yield from ((body, True) for body in broken)


@pytest.mark.parametrize("path", BODIES)
def test_no_body_is_more_than_refused(desk, path):
    ask = desk.server.ask
    version = json.loads(ask("GET", "/api/document")[1])["version"]
    connection = http.client.HTTPConnection("127.0.0.1", desk.server.port, timeout=60)
    headers = {"Content-Type": "application/json", "If-Match": version, "Cookie": desk.server.cookie}
    for body, malformed in hostile_bodies(BODIES[path]):
        connection.request("POST", path, body, headers)
        answer = connection.getresponse()
        text = answer.read().decode()
        assert (answer.status == 200 and not malformed) or refused(answer.status, text), body[:200]
    connection.close()
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"):
        assert refused(*ask("POST", path, BODIES[path] % GOOD, {"Content-Type": kind, "If-Match": version})), kind
    for method in ("PUT", "PATCH", "OPTIONS", "TRACE", "HEAD"):
        assert ask(method, path)[0] in (404, 405)


def test_a_file_with_half_a_surrogate_pair_is_named_and_left_alone(desk):
    before = desk.annotations.read_bytes()
    broken = before.replace(b'"red delivery van"', HALF)
    version = json.loads(desk.server.ask("GET", "/api/document")[1])["version"]
    headers = {"Content-Type": "application/json", "If-Match": version}
    asked = [("POST", "/api/import", json.dumps({"text": broken.decode()}), headers)]
    asked += [("GET", f"/api/{path}") for path in ("document", "export", "coco", "objects/0/anchors")]
    try:
        for request in asked:
            status, text = desk.server.ask(*request)
            assert refused(status, text)
            assert "objects[0].name: \\ud800 is half of a surrogate pair" in json.loads(text)["error"]
            desk.annotations.write_bytes(broken)
        assert desk.annotations.read_bytes() == broken
    finally:
        desk.annotations.write_bytes(before)


ADDRESSES = [
    "/api/objects/%s/anchors", "/api/nodes/%s", "/api/document?client=%s", "/api/picture?x=%s&y=0&z=5&yaw_deg=0",
    "/api/picture?x=0&y=0&z=5&yaw_deg=%s", "/annotate/%s", "/static/%s", "/%s",
]  # fmt: skip
VIEWED = [
    f"/scenes/{YARD}/api/routes/%s", f"/scenes/{YARD}/api/objects/%s/image", f"/scenes/{YARD}/api/objects/%s/thumb",
    "/scenes/%s/", "/scenes/%s/picture", "/scenes/%s/api/index", "/api/tasks?offset=%s",
    "/api/tasks?words=%s&scene=%s", "/api/tasks?order=%s", "/static/%s", "/%s?x=%s",
]  # fmt: skip
PARTS = [
    "9" * 5000, "-1", "1e999", "nan", "%ED%A0%80", "%00", "%0a%0d", "..%2f..%2fetc", "%ff%fe", "x" * 9000, "1%27--",
    "%F0%9F%9A%81",
]  # fmt: skip
HEADERS = [
    {"Content-Length": "9" * 5000}, {"Content-Length": "-1"}, {"If-None-Match": "\xff" * 100}, {"Host": ""},
    {"If-Match": "x" * 4000}, {"Cookie": "\xff=;;=="}, {"Connection": "upgrade", "Upgrade": "websocket"},
]  # fmt: skip


@pytest.fixture(scope="module")
def viewer(view_url):
    return Server(urlsplit(view_url).port)


def test_no_address_is_more_than_refused(desk, viewer):
    for server, addresses in ((desk.server, ADDRESSES), (viewer, VIEWED)):
        for path in (address.replace("%s", part) for address in addresses for part in PARTS):
            status, text = server.ask("GET", path)
            assert status in (200, 304) or refused(status, text), path[:80]
    for headers in HEADERS:
        with contextlib.suppress(ConnectionError, http.client.HTTPException):
            assert desk.server.ask("GET", "/api/facts", None, headers)[0] < 500, headers
    assert desk.server.serves()
    assert viewer.serves()


ESCAPES = [
    "/{static}/../{file}", "/{static}/..%2f{file}", "/{static}/%2e%2e/{file}", "/{static}/%2e%2e%2f{file}",
    "/{static}/..%5c{file}", "/{static}//etc/passwd", "/{static}/%2fetc%2fpasswd", "/{static}/....//{file}",
    "/{static}/../../../../../../../etc/passwd", "/../{file}", "/{static}/", "/static/three",
    "/static/three/../../serving.py", "/../../etc/passwd",
]  # fmt: skip
OF_VIEW = ["/scenes/..%2f..%2fserving.py", f"/scenes/{YARD}/api/routes/..%2f..%2fscene"]
OF_ANNOTATE = ["/api/objects/..%2f0/anchors", "/api/nodes/../../../etc/passwd"]


def test_paths_do_not_escape(desk, viewer):
    # Not httpx or a browser: they tidy the path up before they send it.
    annotating_page = [path.format(static="annotate", file="server.py") for path in ESCAPES] + OF_ANNOTATE
    viewing_page = [path.format(static="static", file="serving.py") for path in ESCAPES] + OF_VIEW
    for server, paths in ((desk.server, annotating_page), (viewer, viewing_page)):
        for path in paths:
            status, text = server.ask("GET", path)
            assert status == 404, (path, text)
            assert "import" not in text, path
            assert "root:" not in text, path


# ---- half requests ----


def closed(client):
    """Whether the server has let go of a connection."""
    client.setblocking(False)
    try:
        while data := client.recv(4096):
            assert data.startswith(b"HTTP/1.1 408 ")
    except BlockingIOError:
        return False
    except ConnectionError:
        return True
    return True


@pytest.mark.parametrize("begun", ["", "GET / HTTP/1.1\r\nHost: x", "POST /api/undo HTTP/1.1\r\nHost: 127.0.0.1\r\n"])
def test_half_requests_lock_nobody_out_and_end(desk, begun):
    if begun.startswith("POST"):
        begun += f"Cookie: {desk.server.cookie}\r\nContent-Length: 9\r\n\r\n{{"
    with contextlib.ExitStack() as stack:
        half = []
        for k in range(300):
            half.append(stack.enter_context(desk.server.connect()))
            with contextlib.suppress(ConnectionError):
                half[-1].sendall(begun.encode())
            if k % 50 == 49:
                assert desk.server.serves()
        assert desk.server.serves("127.0.0.2")  # another client, too
        assert sum(not closed(client) for client in half) <= MAX_PER_CLIENT
        if begun.startswith("GET"):
            until("all of them are closed", lambda: all(closed(client) for client in half))
        assert desk.server.serves()


def test_a_request_that_comes_drop_by_drop_is_given_up(desk):
    with desk.server.connect() as slow:
        said = b""
        slow.settimeout(0.5)
        with contextlib.suppress(ConnectionError):
            for byte in b"GET / HTTP/1.1\r\nHost: x\r\nX: " + b"x" * 200:
                slow.sendall(bytes([byte]))
                with contextlib.suppress(TimeoutError):
                    said = slow.recv(200)
                    break
        # Long before all of it is sent.
        assert said.startswith(b"HTTP/1.1 408 ")


def test_rubbish_does_not_fill_the_log(desk):
    for _ in range(400):
        with desk.server.connect() as client:
            client.sendall(b"\x16\x03\x01 rubbish\r\n\r\n")
            client.recv(200)
    assert desk.server.serves()


def test_guesses_of_the_token_are_slowed(desk):
    def guess(path="/", **headers):
        answer, _ = desk.server.send("GET", path, headers={"Cookie": ""} | headers, source="127.0.0.9")
        return answer.status, answer.getheader("Retry-After")

    assert guess() == (401, None)  # no guess, and neither is an old token that a tab sends on and on
    assert {guess(Cookie="aerialdojo-annotate=of-yesterday")[0] for _ in range(20)} == {401}
    statuses = [guess(f"/?token=x{k}")[0] for k in range(15)]
    statuses += [guess(Cookie=f"aerialdojo-annotate=x{k}")[0] for k in range(15)]
    assert statuses[:9] == [401] * 9
    assert statuses.count(401) <= 14
    assert set(statuses[14:]) == {429}
    # Not even the right one is looked at, and so tells nothing; others are not concerned.
    status, wait = guess(f"/?token={desk.token}")
    assert (status, 0 < int(wait) <= 10) == (429, True)
    assert desk.server.ask("GET", f"/?token={desk.token}")[0] == 303
    time.sleep(int(wait) + 1)
    assert guess(f"/?token={desk.token}")[0] == 303
    # Who has come in is not locked out by a neighbour's guesses.
    assert 401 in [guess(f"/?token=y{k}")[0] for k in range(20)]
    assert guess("/api/facts", Cookie=desk.server.cookie)[0] == 200


@pytest.mark.parametrize(
    ("command", "missing", "module"), [("view", "fastapi", "view.server"), ("annotate", "uvicorn", "annotate.server")]
)
def test_a_page_without_the_web_extra_names_it(tmp_path, monkeypatch, command, missing, module):
    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.delitem(sys.modules, f"aerialdojo_gen.studio.{module}", raising=False)
    done = called(command, "--scene", YARD, "--data", tmp_path / "data")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"error: the page lacks the package {missing}: pip install 'aerialdojo-gen[web]'\n"
    assert not (tmp_path / "data").exists()
