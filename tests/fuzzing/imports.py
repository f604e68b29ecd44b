"""Task files of `import-benchmark`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from fuzzing.cases import Case, Target, made
from support import task_files

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.exchange.importing import Options, import_benchmark


def _aerialdojo() -> list[Case]:
    return [
        made(lambda folder, turn=turn: task_files.put_authors(folder, *task_files.authors(turn))) for turn in (15, 60)
    ]


def _import(format_name: str, file: str = "tasks.json") -> Callable[[Path], None]:
    def run(folder: Path) -> None:
        frame = "ned" if format_name in ("cityavos", "openfly") else None
        for skip_bad in (False, True):
            options = Options(frame=frame, skip_bad=skip_bad)
            try:
                report = import_benchmark(format_name, [folder / file], folder / "data", options, force=True)
            except AerialDojoError:
                if skip_bad:
                    raise
            else:
                json.dumps(report.document()).encode()
                break

    return run


def _of(format_name: str, document: Callable[[Path], object]) -> Target:
    def cases() -> list[Case]:
        return [made(lambda folder: task_files.write(folder / "tasks.json", document(folder)))]

    return Target(cases, _import(format_name), ".json", names_the_file=False)


TARGETS = {
    "import-aerialdojo": Target(_aerialdojo, _import("aerialdojo", "."), ".json", names_the_file=False),
    "import-uav-on": _of("uav-on", lambda _: task_files.uav_on(2)),
    "import-cityavos": _of("cityavos", task_files.cityavos),
    "import-aerialvln": _of("aerialvln", lambda _: task_files.aerialvln()),
    "import-openfly": _of("openfly", lambda _: task_files.openfly()),
}
