"""A Hugging Face Hub of its own at 127.0.0.1: what huggingface_hub asks of one to send and fetch a data set."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import threading
import urllib.parse
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

TOKEN = "hf_aTokenOfTheTestsOwnHub1234567890"
READER = "hf_aTokenThatMayOnlyRead12345678901"


@dataclass
class Repo:
    private: bool = False
    files: dict = field(default_factory=dict)  # path: bytes
    commits: int = 0

    @property
    def sha(self):
        said = json.dumps(sorted((p, hashlib.sha256(b).hexdigest()) for p, b in self.files.items()))
        return hashlib.sha1(f"{self.commits} {said}".encode()).hexdigest()


class Hub(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self):
        super().__init__(("127.0.0.1", 0), _Handler)
        self.repos, self.objects, self.calls = {}, {}, Counter()
        # After so many bodies of files were sent or fetched the server says 403 to all; None for never.
        self.gives_up_after = None
        # What is sent in place of a file's bytes, by its path.
        self.spoilt = {}
        self.lock = threading.Lock()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server_address[1]}"


@contextmanager
def hub_server():
    server = Hub()
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()


def is_large(path):
    return path.endswith((".parquet", ".glb"))


def git_id(content):
    return hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest()


def _listed(path, content):
    entry = {"size": len(content), "oid": git_id(content), "type": "file", "path": path}
    if is_large(path):
        digest = hashlib.sha256(content).hexdigest()
        entry["lfs"] = {"oid": digest, "sha256": digest, "size": len(content), "pointerSize": 130}
    return entry


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Hub

    def log_message(self, *arguments):
        pass

    def _handle(self):
        method = self.command
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        if (self.headers.get("Transfer-Encoding") or "") == "chunked":
            body = self._chunks()
        path = urllib.parse.unquote(urllib.parse.urlsplit(self.path).path)
        with self.server.lock:
            for verb, pattern, answer in _ROUTES:
                if verb in (method, "GET" if method == "HEAD" else "") and (at := re.fullmatch(pattern, path)):
                    answer(self, body, *at.groups())
                    return
            self._say(404, {"error": f"no route {method} {path}"})

    do_GET = do_HEAD = do_POST = do_PUT = _handle  # noqa: N815 - as the server calls them

    def _chunks(self):
        body = b""
        while size := int(self.rfile.readline().split(b";")[0], 16):
            body += self.rfile.read(size)
            self.rfile.readline()
        self.rfile.readline()
        return body

    # -- who asks --

    @property
    def token(self):
        return (self.headers.get("Authorization") or "").removeprefix("Bearer ")

    def _repo(self, name, writes=False):
        """The data set, or None where an error was said."""
        repo = self.server.repos.get(name)
        if self.token and self.token not in (TOKEN, READER):
            self._say(401, {"error": "Invalid credentials in Authorization header"})
            return None
        if repo is None or (repo.private and not self.token):
            self._say(404 if self.token else 401, {"error": "Repository not found"}, {"X-Error-Code": "RepoNotFound"})
            return None
        if writes and self.token != TOKEN:
            self._say(403, {"error": "You have no right to write here"})
            return None
        return repo

    def _say(self, status, document=None, headers=None, content=None):
        body = json.dumps(document).encode() if content is None else content
        self.send_response(status)
        for key, value in {"Content-Type": "application/json", **(headers or {})}.items():
            self.send_header(key, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def _has_given_up(self, what):
        self.server.calls[what] += 1
        done = self.server.calls["sent"] + self.server.calls["fetched"]
        if self.server.gives_up_after is None or done <= self.server.gives_up_after:
            return False
        self._say(403, {"error": "out of order"})
        return True

    # -- what is asked --

    def create(self, body):
        asked = json.loads(body)
        if self.token != TOKEN:
            known = self.token == READER
            self._say(403 if known else 401, {"error": "no right" if known else "Invalid username or password."})
            return
        name = f"{asked.get('organization') or 'me'}/{asked['name']}"
        if name in self.server.repos:
            self._say(409, {"error": "You already created this dataset repo", "url": self._url(name)})
            return
        self.server.repos[name] = Repo(private=bool(asked.get("private")) or asked.get("visibility") == "private")
        self._say(200, {"url": self._url(name), "id": name})

    def _url(self, name):
        return f"{self.server.url}/datasets/{name}"

    def info(self, body, name, revision="main"):
        repo = self._repo(name)
        if repo is None:
            return
        if revision not in ("main", repo.sha):
            self._say(404, {"error": "Invalid rev id"}, {"X-Error-Code": "RevisionNotFound"})
            return
        siblings = []
        for path, content in sorted(repo.files.items()):
            listed = _listed(path, content)
            siblings.append({"rfilename": path, "size": listed["size"], "blobId": listed["oid"], **(
                {"lfs": listed["lfs"]} if "lfs" in listed else {})})  # fmt: skip
        self._say(200, {
            "_id": "1", "id": name, "sha": repo.sha, "private": repo.private, "tags": [], "downloads": 0, "likes": 0,
            "siblings": siblings,
        })  # fmt: skip

    def tree(self, body, name, revision):
        repo = self._repo(name)
        if repo is not None:
            self._say(200, content=json.dumps([_listed(*item) for item in sorted(repo.files.items())]).encode())

    def yaml(self, body):
        self._say(200, {"errors": [], "warnings": []})

    def preupload(self, body, name, revision):
        repo = self._repo(name, writes=True)
        if repo is not None:
            files = [
                {"path": f["path"], "uploadMode": "lfs" if is_large(f["path"]) else "regular", "shouldIgnore": False,
                 **({"oid": _listed(f["path"], repo.files[f["path"]]).get("lfs", {}).get("oid")
                     or git_id(repo.files[f["path"]])} if f["path"] in repo.files else {})}
                for f in json.loads(body)["files"]
            ]  # fmt: skip
            self._say(200, {"files": files})

    def batch(self, body, name):
        if self._repo(name, writes=True) is None:
            return
        objects = []
        for wanted in json.loads(body)["objects"]:
            entry = {"oid": wanted["oid"], "size": wanted["size"]}
            if wanted["oid"] not in self.server.objects:
                entry["actions"] = {"upload": {"href": f"{self.server.url}/lfs/{wanted['oid']}", "header": {}}}
            objects.append(entry)
        self._say(200, {"transfer": "basic", "objects": objects})

    def put(self, body, oid):
        if self._has_given_up("sent"):
            return
        if hashlib.sha256(body).hexdigest() != oid:
            self._say(400, {"error": "another object"})
            return
        self.server.objects[oid] = body
        self._say(200, {})

    def commit(self, body, name, revision):
        repo = self._repo(name, writes=True)
        if repo is None:
            return
        files = dict(repo.files)
        for line in map(json.loads, filter(None, body.split(b"\n"))):
            value = line["value"]
            if line["key"] == "file":
                files[value["path"]] = base64.b64decode(value["content"])
            elif line["key"] == "lfsFile":
                files[value["path"]] = self.server.objects[value["oid"]]
            elif line["key"] == "deletedFile":
                del files[value["path"]]
        repo.files, repo.commits = files, repo.commits + 1
        self._say(200, {"success": True, "commitOid": repo.sha, "commitUrl": f"{self._url(name)}/commit/{repo.sha}"})

    def resolve(self, body, name, revision, path):
        repo = self._repo(name)
        if repo is None:
            return
        if path not in repo.files:
            self._say(404, {"error": "Entry not found"}, {"X-Error-Code": "EntryNotFound"})
            return
        if self.command == "GET" and self._has_given_up("fetched"):
            return
        content = repo.files[path]
        listed = _listed(path, content)
        etag = listed.get("lfs", {}).get("oid") or listed["oid"]
        headers = {"X-Repo-Commit": repo.sha, "ETag": f'"{etag}"', "Content-Type": "application/octet-stream"}
        if "lfs" in listed:
            headers |= {"X-Linked-Etag": f'"{etag}"', "X-Linked-Size": str(len(content))}
        self._say(200, headers=headers, content=self.server.spoilt.get(path, content))


_NAME = r"([\w.-]+/[\w.-]+)"
_ROUTES = (
    ("POST", r"/api/repos/create", _Handler.create),
    ("POST", r"/api/validate-yaml", _Handler.yaml),
    ("GET", rf"/api/datasets/{_NAME}", _Handler.info),
    ("GET", rf"/api/datasets/{_NAME}/revision/([^/]+)", _Handler.info),
    ("GET", rf"/api/datasets/{_NAME}/tree/([^/]+)", _Handler.tree),
    ("POST", rf"/api/datasets/{_NAME}/preupload/([^/]+)", _Handler.preupload),
    ("POST", rf"/api/datasets/{_NAME}/commit/([^/]+)", _Handler.commit),
    ("POST", rf"/datasets/{_NAME}\.git/info/lfs/objects/batch", _Handler.batch),
    ("PUT", r"/lfs/([0-9a-f]{64})", _Handler.put),
    ("GET", rf"/datasets/{_NAME}/resolve/([^/]+)/(.+)", _Handler.resolve),
)
