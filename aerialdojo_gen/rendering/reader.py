"""Read recordings back as arrays, one frame at a time.

>>> recording = read_recording(Path("data/media/U_Mall_0/<nav_id>"))  # doctest: +SKIP
>>> recording.rgb["front"][12]        # (640, 640, 3) uint8, decoded now
>>> recording.depth_m["down"][12]     # (640, 640) float32, metres, inf where nothing lies within range
>>> recording.cameras["front"]["K"]   # intrinsics; pixel centres are at (column + 0.5, row + 0.5)

Other readers work too: `docs/recordings.md` has examples for PyAV and OpenCV.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import Malformed, RenderError
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.geometry.arrays import Singles
from aerialdojo_gen.rendering.codecs import SUFFIX, to_metres
from aerialdojo_gen.rendering.placement import TILED
from aerialdojo_gen.rendering.video import Frames, Tile, Video


class DepthVideo(Frames):
    """Depth in metres, over a `Video` of the stored values.

    Attributes
    ----------
    stored : Video
        The stored values, (H, W) uint16; 0 where nothing lies within range.
    step : float
        0 where these are millimetres, else the share by which they grow (`codecs.to_stored`).
    """

    def __init__(self, video: Video, step: float = 0.0) -> None:
        self.path, self.stored = video.path, video
        self.step = step  # 0 where the stored values are millimetres, else the share by which they grow

    @property
    def millimetres(self) -> Video:
        """The stored values, where they are millimetres; RenderError where they are not."""
        if self.step:
            raise RenderError(f"{self.path} stores relative steps of {self.step:g}, not millimetres")
        return self.stored

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.stored)

    def _decode(self, k: int) -> Singles:
        return to_metres(self.stored[k], self.step)


@dataclass(frozen=True)
class Recording:
    """All videos of one trajectory.

    Attributes
    ----------
    rgb : dict of str to Video
        By view; frames are (H, W, 3) uint8.
    depth_m : dict of str to DepthVideo
        By view; frames are (H, W) float32, planar depth in metres, inf where nothing lies within range.
    cameras : dict of str to dict
        By view: ``K`` (3 x 3, pixels), ``body_from_camera`` (4 x 4; body x forward, y left, z up), ``fov_deg``,
        ``pixel_centre``.
    fps : float
        Frames a second; 0 for PNG files, whose frames' times stand in the table ``frames``.
    instance : dict of str to Video
        By view, where they were recorded; frames are (H, W) uint16: number of the node in the scene's mesh, plus 1.
    """

    rgb: dict[str, Video]
    depth_m: dict[str, DepthVideo]
    cameras: dict[str, dict[str, Any]]
    fps: float
    instance: dict[str, Video]

    def __len__(self) -> int:
        """Return the number of frames, the same in every video."""
        return len(next(iter(self.rgb.values())))


def read_recording(folder: str | Path) -> Recording:
    """Open a recording.

    Parameters
    ----------
    folder : str or Path
        ``<data>/media/<scene>/<nav_id>``.

    Returns
    -------
    Recording
        Nothing is decoded yet.

    Raises
    ------
    RenderError
        There is no recording, a video is missing or damaged, or the videos differ in length.
    """
    folder = Path(folder)
    if (folder / TILED).is_file():
        videos = _tiles(folder / TILED)
    else:
        videos = {modality: _videos(folder, modality) for modality in SUFFIX}
        rgb, depth, instance = videos.values()
        if not rgb or rgb.keys() != depth.keys() or (instance and instance.keys() != rgb.keys()):
            raise RenderError(f"no complete recording in {folder}: run {command('render')}")
        if len({len(v) for v in (*rgb.values(), *depth.values(), *instance.values())}) != 1:
            raise RenderError(f"the videos in {folder} differ in length: render them again")
    cameras = {view: _camera(video) for view, video in videos["rgb"].items()}
    depth_m = {view: DepthVideo(video, _step(video)) for view, video in videos["depth"].items()}
    fps = next(iter(videos["rgb"].values())).fps
    return Recording(videos["rgb"], depth_m, cameras, fps, videos.get("instance", {}))


def open_view(path: str | Path, view: str, modality: str) -> Video:
    """Open the video of one view and modality in a file that a row of `recordings` names."""
    path = Path(path)
    if path.name != TILED:
        return Video(path)
    found = _tiles(path).get(modality, {}).get(view)
    if found is None:
        raise RenderError(f"{path} has no {modality} of the view {view}: render it again")
    return found


def _tiles(path: Path) -> dict[str, dict[str, Video]]:
    """Open the views of a tiled file, by modality and view."""
    first = Video(path)
    metadata = _camera(first)
    cameras, names = metadata.get("tiles"), metadata.get("streams")
    if not (
        isinstance(cameras, dict) and cameras and all(isinstance(c, dict) for c in cameras.values())
        and isinstance(names, list) and names[:2] == ["rgb", "depth"] and names[2:] in ([], ["instance"])
    ):  # fmt: skip
        raise RenderError(f"{path} has no list of its views: render it again")
    videos = {name: first if k == 0 else Video(path, k) for k, name in enumerate(names)}
    if len({len(whole) for whole in videos.values()}) != 1:
        raise RenderError(f"the videos in {path} differ in length: render them again")
    return {name: {view: Tile(whole, camera) for view, camera in cameras.items()} for name, whole in videos.items()}


def _step(video: Video) -> float:
    """Return the step of stored depth; old recordings have none: millimetres."""
    step = _camera(video).get("depth_step", 0.0)
    if type(step) not in (int, float) or not 0.0 <= step <= 0.1:
        raise RenderError(f"{video.path}: its camera comment has no depth_step from 0 to 0.1")
    return float(step)


def _camera(video: Video) -> dict[str, Any]:
    try:
        camera = loads_json(video.metadata.get("comment", "{}"))
    except Malformed as error:
        raise RenderError(f"{video.path}: its camera comment {error}: render it again") from None
    if not isinstance(camera, dict):
        raise RenderError(f"{video.path}: its camera comment is no JSON object: render it again")
    return camera


def _videos(folder: Path, modality: str) -> dict[str, Video]:
    paths = [
        *folder.glob(f"*_{modality}.{SUFFIX[modality]}"),
        *(p for p in folder.glob(f"*_{modality}") if p.is_dir()),
    ]
    return {p.stem.removesuffix(f"_{modality}"): Video(p) for p in sorted(paths)}
