"""The code that an evaluation's episodes come from: a run that was begun with other code is not gone on with."""

from __future__ import annotations

import hashlib
import importlib.util
import json
from pathlib import Path

from aerialdojo_gen.benchmark.agents.load import BUILT_IN, look_here
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.store.files import file_digest


def flying_code(agent: str) -> str:
    """Digest the code that flies an agent.

    Libraries do not count, as they do for stages: an episode may have cost money, and a library's next patch should
    not end a run of a thousand of them.
    """
    module = BUILT_IN.get(agent, agent).partition(":")[0]
    parts = dict(code_of("aerialdojo_gen.benchmark.worker").parts)
    if module.split(".")[0] == "aerialdojo_gen":
        parts |= code_of(module).parts
    elif (path := _file_of(module)) is not None:
        parts[module] = file_digest(path)
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _file_of(module: str) -> Path | None:
    look_here()
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.origin and Path(spec.origin).is_file() else None
