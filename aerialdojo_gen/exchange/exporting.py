"""The release in formats of others: whole or not at all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.exchange import aerialdojo_writer, habitat_writer
from aerialdojo_gen.exchange.folder import whole_folder, write_json
from aerialdojo_gen.exchange.size import check_room, size_of
from aerialdojo_gen.exchange.tars import pack
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store.root import Where, open_root

MARKER = "export.json"
PICTURE_PX = 640
# So many that file systems, copies and hubs become slow.
_MANY_FILES = 10_000
FORMATS = {
    "aerialdojo": ("north, east, down, metres; quaternions xyzw; forward +x", aerialdojo_writer.LOST),
    "habitat": ("east, up, south, metres; quaternions xyzw; forward -z", habitat_writer.LOST),
}


def export_release(
    format_name: str,
    data: Where,
    out: Path,
    scenes: Sequence[str] | None = None,
    *,
    force: bool = False,
    picture_px: int | None = None,
    shards: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, int]:
    """Write the release in a format of others."""
    if format_name not in FORMATS:
        raise UsageError(unknown("no format", format_name, FORMATS))
    if picture_px is not None and (format_name != "aerialdojo" or not (picture_px == 0 or 16 <= picture_px <= 4096)):
        raise UsageError("--picture-size is for --format aerialdojo: 16 to 4096 pixels, or 0 for the release's own")
    root = open_root(data)
    chosen = scenes_in_release(root, scenes)
    frame, lost = FORMATS[format_name]
    size_px = PICTURE_PX if picture_px is None else picture_px
    if shards and format_name != "aerialdojo":
        raise UsageError(f"--shards is for --format aerialdojo: {format_name} has a file a scene as it is")
    counts: Counter[str] = Counter(scenes=len(chosen))
    reporter = reporter or Reporter(quiet=True)
    with whole_folder(out, MARKER, force=force) as folder:
        size = size_of(format_name, root, chosen, size_px)
        instead = ""
        if shards:
            instead = f", as {len(chosen)} archives"
        elif size.files > _MANY_FILES:
            instead = f"; --shards writes {len(chosen) + 1} files in their place"
        reporter.line(f"export: {size}{instead}, into {out}")
        check_room(out, size.bytes if shards else size.on_disk)
        categories = {} if format_name == "aerialdojo" else habitat_writer.categories_of(root, chosen)
        if format_name == "habitat":
            habitat_writer.write_index(folder, categories)
        with reporter.bar("export", len(chosen), "scenes") as bar:
            for scene in chosen:
                if format_name == "habitat":
                    counts.update(habitat_writer.write_scene(root, scene, folder, categories))
                elif shards:
                    counts.update(aerialdojo_writer.write_scene(root, scene, folder / scene, size_px))
                    pack(folder / scene, folder / f"{scene}.tar")
                else:
                    counts.update(aerialdojo_writer.write_scene(root, scene, folder, size_px))
                bar.advance()
        write_json(
            folder / MARKER,
            {
                "format": format_name,
                "written_by": f"aerialdojo-gen {__version__}",
                "frame": frame,
                "scenes": list(chosen),
                "counts": dict(counts),
                "actions": None
                if format_name == "aerialdojo"
                else {str(k): v for k, v in habitat_writer.ACTIONS.items()},
                "lost": {table: list(columns) for table, columns in lost.items()},
            },
        )
    return dict(counts)
