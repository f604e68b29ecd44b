"""A Hugging Face Hub of its own at 127.0.0.1: what huggingface_hub asks of one to send and fetch a data set."""

import base64
import hashlib
import json
import threading
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated, Any

import uvicorn
from fastapi import Depends, FastAPI, HTTPException, Request
from fastapi.responses import JSONResponse, Response

from aerialdojo_gen.studio.web.serving import open_socket, url_of

TOKEN = "hf_aTokenOfTheTestsOwnHub1234567890"
READER = "hf_aTokenThatMayOnlyRead12345678901"


@dataclass
class Repo:
    private: bool = False
    files: dict[str, bytes] = field(default_factory=dict)
    commits: int = 0

    @property
    def sha(self):
        said = json.dumps(sorted((p, hashlib.sha256(b).hexdigest()) for p, b in self.files.items()))
        return hashlib.sha1(f"{self.commits} {said}".encode()).hexdigest()


@dataclass
class Hub:
    """What is there, what was asked for, and what the server does wrong."""

    url: str
    repos: dict[str, Repo] = field(default_factory=dict)
    objects: dict[str, bytes] = field(default_factory=dict)
    calls: Counter[str] = field(default_factory=Counter)
    # After so many bodies of files were sent or fetched the server says 403 to all; None for never.
    gives_up_after: int | None = None
    # What is sent in place of a file's bytes, by its path.
    spoilt: dict[str, bytes] = field(default_factory=dict)

    def count(self, what):
        self.calls[what] += 1
        if self.gives_up_after is not None and self.calls["sent"] + self.calls["fetched"] > self.gives_up_after:
            raise HTTPException(403, "out of order")


@contextmanager
def hub_server():
    listener = open_socket(0)
    hub = Hub(url_of(listener).rstrip("/"))
    server = uvicorn.Server(uvicorn.Config(_app(hub), log_level="critical", lifespan="off"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        yield hub
    finally:
        server.should_exit = True
        thread.join()
        listener.close()


def is_large(path):
    return path.endswith((".parquet", ".glb"))


def _listed(path, content):
    digest, oid = hashlib.sha256(content).hexdigest(), hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest()
    lfs = {"lfs": {"oid": digest, "sha256": digest, "size": len(content), "pointerSize": 130}}
    return {"size": len(content), "oid": oid, "type": "file", "path": path, **(lfs if is_large(path) else {})}


def _missing(status, what, code):
    return HTTPException(status, f"{what} not found", {"X-Error-Code": code})


def _token(request: Request):
    return request.headers.get("authorization", "").removeprefix("Bearer ")


def _app(hub: Hub) -> FastAPI:
    app = FastAPI()

    def readable(owner: str, repo: str, token: Annotated[str, Depends(_token)]):
        there = hub.repos.get(f"{owner}/{repo}")
        if token and token not in (TOKEN, READER):
            raise HTTPException(401, "Invalid credentials in Authorization header")
        if there is None or (there.private and not token):
            raise _missing(404 if token else 401, "Repository", "RepoNotFound")
        return there

    def writable(there: Annotated[Repo, Depends(readable)], token: Annotated[str, Depends(_token)]):
        if token != TOKEN:
            raise HTTPException(403, "You have no right to write here")
        return there

    @app.exception_handler(HTTPException)
    async def refused(_request: Request, error: HTTPException):
        return JSONResponse({"error": error.detail}, error.status_code, error.headers)

    @app.post("/api/repos/create")
    async def create(asked: dict[str, Any], token: Annotated[str, Depends(_token)]):
        name = f"{asked.get('organization') or 'me'}/{asked['name']}"
        made = {"url": f"{hub.url}/datasets/{name}", "id": name}
        if token != TOKEN:
            raise HTTPException(403, "no right") if token == READER else HTTPException(401, "Invalid password.")
        if name in hub.repos:
            return JSONResponse(made | {"error": "You already created this dataset repo"}, 409)
        hub.repos[name] = Repo(private=bool(asked.get("private")) or asked.get("visibility") == "private")
        return made

    @app.post("/api/validate-yaml")
    async def yaml():
        return {"errors": [], "warnings": []}

    @app.get("/api/datasets/{owner}/{repo}")
    @app.get("/api/datasets/{owner}/{repo}/revision/{revision}")
    async def info(owner: str, repo: str, there: Annotated[Repo, Depends(readable)], revision: str = "main"):
        if revision not in ("main", there.sha):
            raise _missing(404, "Revision", "RevisionNotFound")
        listed = [_listed(*item) for item in sorted(there.files.items())]
        siblings = [
            {"rfilename": one.pop("path"), "blobId": one.pop("oid"), **{k: v for k, v in one.items() if k != "type"}}
            for one in listed
        ]
        about = {"private": there.private, "tags": [], "downloads": 0, "likes": 0, "siblings": siblings}
        return {"_id": "1", "id": f"{owner}/{repo}", "sha": there.sha, **about}

    @app.get("/api/datasets/{owner}/{repo}/tree/{revision}")
    async def tree(there: Annotated[Repo, Depends(readable)]):
        return [_listed(*item) for item in sorted(there.files.items())]

    @app.post("/api/datasets/{owner}/{repo}/preupload/{revision}")
    async def preupload(there: Annotated[Repo, Depends(writable)], asked: dict[str, Any]):
        def answer(path):
            known = _listed(path, there.files[path]) if path in there.files else {}
            oid = {"oid": known.get("lfs", known)["oid"]} if known else {}
            return {"path": path, "uploadMode": "lfs" if is_large(path) else "regular", "shouldIgnore": False} | oid

        return {"files": [answer(file["path"]) for file in asked["files"]]}

    @app.post("/datasets/{owner}/{repo}.git/info/lfs/objects/batch", dependencies=[Depends(writable)])
    async def batch(asked: dict[str, Any]):
        def answer(oid, size):
            upload = {"actions": {"upload": {"href": f"{hub.url}/lfs/{oid}", "header": {}}}}
            return {"oid": oid, "size": size} | ({} if oid in hub.objects else upload)

        return {"transfer": "basic", "objects": [answer(one["oid"], one["size"]) for one in asked["objects"]]}

    @app.put("/lfs/{oid}")
    async def put(oid: str, request: Request):
        content = await request.body()
        hub.count("sent")
        if hashlib.sha256(content).hexdigest() != oid:
            raise HTTPException(400, "another object")
        hub.objects[oid] = content
        return {}

    @app.post("/api/datasets/{owner}/{repo}/commit/{revision}")
    async def commit(owner: str, repo: str, there: Annotated[Repo, Depends(writable)], request: Request):
        files = dict(there.files)
        for line in map(json.loads, filter(None, (await request.body()).split(b"\n"))):
            value = line["value"]
            if line["key"] == "file":
                files[value["path"]] = base64.b64decode(value["content"])
            elif line["key"] == "lfsFile":
                files[value["path"]] = hub.objects[value["oid"]]
            elif line["key"] == "deletedFile":
                del files[value["path"]]
        there.files, there.commits = files, there.commits + 1
        page = f"{hub.url}/datasets/{owner}/{repo}/commit/{there.sha}"
        return {"success": True, "commitOid": there.sha, "commitUrl": page}

    @app.api_route("/datasets/{owner}/{repo}/resolve/{revision}/{path:path}", methods=["GET", "HEAD"])
    async def resolve(there: Annotated[Repo, Depends(readable)], request: Request, path: str):
        if path not in there.files:
            raise _missing(404, "Entry", "EntryNotFound")
        if request.method == "GET":
            hub.count("fetched")
        listed = _listed(path, there.files[path])
        headers = {"X-Repo-Commit": there.sha, "ETag": f'"{listed.get("lfs", listed)["oid"]}"'}
        if "lfs" in listed:
            headers |= {"X-Linked-Etag": headers["ETag"], "X-Linked-Size": str(listed["size"])}
        return Response(hub.spoilt.get(path, there.files[path]), 200, headers, "application/octet-stream")

    return app
