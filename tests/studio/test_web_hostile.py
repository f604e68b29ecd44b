"""The pages' servers, as started by their commands, against clients that mean no good or send no sense."""

import contextlib
import http.client
import json
import resource
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from support import annotating
from support.browser import until
from support.viewing import YARD, served

from aerialdojo_gen.studio.web.limits import MAX_PER_CLIENT

pytestmark = pytest.mark.slow


def port_of(url):
    return urlsplit(url).port


def ask(port, method, path, body=None, headers=None, host="127.0.0.1"):
    """Send a request as it is; gives status and text."""
    connection = http.client.HTTPConnection(host, port, timeout=60)
    try:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, answer.read().decode("utf-8", "replace")
    finally:
        connection.close()


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
FILE = (
    '{"format": "aerialdojo-annotations", "version": 1, "scene": "U_Courtyard_0", "landmarks": [], "objects": [%s]}'
)
ENTRY = '{"id": 0, "name": "van", "category": "delivery_van", "description": "A van.", "node": "delivery_van_000"}'
FILES = [
    FILE % ENTRY.replace("A van.", "\\ud800"),
    FILE % ENTRY.replace('"name"', '"\\udfff"'),
    FILE.replace("U_Courtyard_0", "\\udc00") % ENTRY,
    FILE % ENTRY.replace('"id": 0', '"id": ' + "9" * 5000),
    FILE % ENTRY.replace("}", ', "anchor": {"position_m": [NaN, 1e999, 0], "yaw_deg": Infinity}}'),
    FILE % ("[" * 50_000),
    "[" * 50_000,
    FILE % "0,".join([""] * 300_000),
    "\ufeff{}",
    "null",
]


@pytest.fixture(scope="module")
def desk(project, tmp_path_factory):
    """The annotation tool's own server: its port and its annotations."""
    folder = tmp_path_factory.mktemp("hostile")
    pipeline = annotating.yard_pipeline(project, folder)
    with annotating.served(project, annotating.YARD, pipeline, folder / "data") as (url, process):
        yield port_of(url), folder / "annotations" / f"{annotating.YARD}.json"
        assert process.poll() is None


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
    port, annotations = desk
    before = annotations.read_bytes()
    version = json.loads(ask(port, "GET", "/api/document")[1])["version"]
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    for body, malformed in hostile_bodies(BODIES[path]):
        connection.request("POST", path, body, {"Content-Type": "application/json", "If-Match": version})
        answer = connection.getresponse()
        text = answer.read().decode()
        assert (answer.status == 200 and not malformed) or refused(answer.status, text), body[:200]
    connection.close()
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"):
        status, text = ask(port, "POST", path, BODIES[path] % GOOD, {"Content-Type": kind, "If-Match": version})
        assert refused(status, text), kind
    for method in ("PUT", "PATCH", "OPTIONS", "TRACE", "HEAD"):
        assert ask(port, method, path)[0] in (404, 405)
    assert annotations.read_bytes() == before


def test_no_file_that_is_taken_over_is_more_than_refused(desk):
    port, annotations = desk
    before = annotations.read_bytes()
    version = json.loads(ask(port, "GET", "/api/document")[1])["version"]
    headers = {"Content-Type": "application/json", "If-Match": version}
    for text in FILES:
        body = json.dumps({"who": "Eve", "client": "hostile", "text": text})
        status, answer = ask(port, "POST", "/api/import", body, headers)
        assert refused(status, answer), text[:200]
    assert "half of a surrogate pair" in ask(port, "POST", "/api/import", json.dumps({"text": FILES[0]}), headers)[1]
    assert annotations.read_bytes() == before


def test_a_file_with_half_a_surrogate_pair_is_named_and_left_alone(desk):
    port, annotations = desk
    before = annotations.read_bytes()
    broken = (FILE % ENTRY.replace("A van.", "\\ud800")).encode()
    try:
        annotations.write_bytes(broken)
        for path in ("/api/document", "/api/export", "/api/coco", "/api/objects/0/anchors"):
            status, text = ask(port, "GET", path)
            assert refused(status, text)
            assert "objects[0].description: \\ud800 is half of a surrogate pair" in json.loads(text)["error"]
        assert annotations.read_bytes() == broken
    finally:
        annotations.write_bytes(before)


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


def test_no_address_is_more_than_refused(desk, smoke):
    with served(smoke, YARD, silent=False) as url:
        for port, addresses in ((desk[0], ADDRESSES), (port_of(url), VIEWED)):
            for address in addresses:
                for part in PARTS:
                    path = address.replace("%s", part)
                    status, text = ask(port, "GET", path)
                    assert status < 500, (path[:80], text[:200])
                    assert status in (200, 304) or refused(status, text), path[:80]
            for headers in HEADERS:
                with contextlib.suppress(ConnectionError, http.client.HTTPException):
                    assert ask(port, "GET", "/api/facts", headers=headers)[0] < 500, headers
            assert ask(port, "GET", "/")[0] == 200


ESCAPES = [
    "/{static}/../{file}", "/{static}/..%2f{file}", "/{static}/%2e%2e/{file}", "/{static}/%2e%2e%2f{file}",
    "/{static}/..%5c{file}", "/{static}//etc/passwd", "/{static}/%2fetc%2fpasswd", "/{static}/....//{file}",
    "/{static}/../../../../../../../etc/passwd", "/../{file}", "/{static}/", "/static/three",
    "/static/three/../../serving.py", "/../../etc/passwd",
]  # fmt: skip
OF_VIEW = ["/scenes/..%2f..%2fserving.py", f"/scenes/{YARD}/api/routes/..%2f..%2fscene"]
OF_ANNOTATE = ["/api/objects/..%2f0/anchors", "/api/nodes/../../../etc/passwd"]


def test_paths_do_not_escape(desk, view_url):
    # Not httpx or a browser: they tidy the path up before they send it.
    annotating_page = [path.format(static="annotate", file="server.py") for path in ESCAPES] + OF_ANNOTATE
    viewing_page = [path.format(static="static", file="serving.py") for path in ESCAPES] + OF_VIEW
    for port, paths in ((desk[0], annotating_page), (port_of(view_url), viewing_page)):
        for path in paths:
            status, text = ask(port, "GET", path)
            assert status == 404, (path, text)
            assert "import" not in text, path
            assert "root:" not in text, path


def test_an_enormous_body_is_refused_unread(desk):
    port, annotations = desk
    before = annotations.read_bytes()
    with socket.create_connection(("127.0.0.1", port), timeout=30) as client:
        client.sendall(
            b"POST /api/import HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nContent-Length: 99999999999\r\n\r\n" % port
        )
        assert client.recv(200).startswith(b"HTTP/1.1 413 ")
    assert annotations.read_bytes() == before


# ---- half requests ----


IMPATIENT = """
from aerialdojo_gen.cli.app import main
from aerialdojo_gen.studio.web import limits

limits.HEAD_S = 2.0
main()
"""


@contextlib.contextmanager
def annotating_for_all(project, folder):
    """``annotate --host 0.0.0.0`` with few files to open, as macOS gives; its port, its token, and its log.

    It waits 2 s in place of 10 s for the rest of a request's head.
    """
    pipeline = annotating.yard_pipeline(project, folder)
    command = [sys.executable, "-c", IMPATIENT, "annotate", "--scene", annotating.YARD, "--no-browser",
               "--pipeline", str(pipeline), "--data", str(folder / "data"), "--host", "0.0.0.0"]  # fmt: skip
    log = folder / "log.txt"
    with log.open("wb") as file:
        process = subprocess.Popen(
            command, cwd=project, stdout=subprocess.PIPE, stderr=file, text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256)),
        )  # fmt: skip
    try:
        line = process.stdout.readline()
        address, _, token = line.split()[3].partition("?token=")
        yield port_of(address), token, log
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)


@pytest.fixture(scope="module")
def outside(project, tmp_path_factory):
    with annotating_for_all(project, tmp_path_factory.mktemp("outside")) as server:
        yield server


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


@pytest.mark.parametrize(
    "begun",
    [b"", b"GET / HTTP/1.1\r\nHost: x", b"POST /api/undo HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n{"],
)
def test_half_requests_lock_nobody_out_and_end(outside, begun):
    port, token, log = outside
    cookie = {"Cookie": f"aerialdojo-annotate={token}"}
    if b"POST" in begun:
        begun = begun.replace(b"\r\n", f"\r\nCookie: {cookie['Cookie']}\r\n".encode(), 1)
    with contextlib.ExitStack() as stack:
        half = []
        for k in range(300):
            client = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=30))
            with contextlib.suppress(ConnectionError):
                client.sendall(begun)
            half.append(client)
            if k % 50 == 49:
                assert ask(port, "GET", "/api/facts", headers=cookie)[0] == 200
        # From another address, too.
        assert ask(port, "GET", "/api/facts", headers=cookie, host="127.0.0.2")[0] == 200
        assert sum(not closed(client) for client in half) <= MAX_PER_CLIENT
        if begun.startswith(b"GET"):
            until("all of them are closed", lambda: all(closed(client) for client in half))
        assert ask(port, "GET", "/api/facts", headers=cookie)[0] == 200
    assert log.stat().st_size < 20_000, log.read_text()[:3000]


def test_a_request_that_comes_drop_by_drop_is_given_up(outside):
    port, _, _ = outside
    with socket.create_connection(("127.0.0.1", port), timeout=30) as slow:
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


def test_rubbish_does_not_fill_the_log(outside):
    port, token, log = outside
    for _ in range(400):
        with socket.create_connection(("127.0.0.1", port), timeout=30) as client:
            client.sendall(b"\x16\x03\x01 rubbish\r\n\r\n")
            client.recv(200)
    assert ask(port, "GET", "/api/facts", headers={"Cookie": f"aerialdojo-annotate={token}"})[0] == 200
    assert log.stat().st_size < 20_000


def test_guesses_of_the_token_are_slowed(outside):
    port, token, _ = outside
    stranger = "127.0.0.9"

    def guess(path="/", **headers):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30, source_address=(stranger, 0))
        try:
            connection.request("GET", path, headers=headers)
            answer = connection.getresponse()
            answer.read()
            return answer.status, answer.getheader("Retry-After")
        finally:
            connection.close()

    assert guess() == (401, None)  # no guess, and neither is an old token that a tab sends on and on
    assert {guess(Cookie="aerialdojo-annotate=of-yesterday")[0] for _ in range(20)} == {401}
    statuses = [guess(f"/?token=x{k}")[0] for k in range(15)] + [
        guess(Cookie=f"aerialdojo-annotate=x{k}")[0] for k in range(15)
    ]
    assert statuses[:9] == [401] * 9
    assert statuses.count(401) <= 14
    assert set(statuses[14:]) == {429}
    # Not even the right one is looked at, and so tells nothing; others are not concerned.
    status, wait = guess(f"/?token={token}")
    assert (status, 0 < int(wait) <= 10) == (429, True)
    assert ask(port, "GET", f"/?token={token}")[0] == 303
    time.sleep(int(wait) + 1)
    assert guess(f"/?token={token}")[0] == 303
    # Who has come in is not locked out by a neighbour's guesses.
    assert 401 in [guess(f"/?token=y{k}")[0] for k in range(20)]
    assert guess("/api/facts", Cookie=f"aerialdojo-annotate={token}")[0] == 200


# ---- without the extra ----

BLOCK = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {missing}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
        return None

sys.meta_path.insert(0, Missing())
"""


@pytest.mark.parametrize(
    ("command", "missing"), [("view", ["fastapi", "starlette", "uvicorn"]), ("annotate", ["uvicorn"])]
)
def test_a_page_without_the_web_extra_names_it(project, tmp_path, command, missing):
    (tmp_path / "sitecustomize.py").write_text(BLOCK.format(missing=missing))
    line = [sys.executable, "-m", "aerialdojo_gen.cli", command, "--scene", YARD, "--data", str(tmp_path / "data")]
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": f"{tmp_path}:{project}"}
    done = subprocess.run(line, cwd=project, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == f"error: the page lacks the package {missing[0]}: pip install 'aerialdojo-gen[web]'\n"
    assert not Path(tmp_path / "data").exists()
