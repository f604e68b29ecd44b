from __future__ import annotations

import json

import av
import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.rendering.codecs import MAX_DEPTH_M, VideoWriter, _frame, to_metres, to_stored
from aerialdojo_gen.rendering.reader import Video, read_recording

N, H, W = 40, 96, 128
U, V = np.meshgrid(np.arange(W), np.arange(H))
DEPTH = [((U * 499 + V * 331 + k * 1777) % 65536).astype(np.uint16) for k in range(N)]
RGB = [
    np.stack([120 + 60 * np.sin((U + 3 * k) / 20), 90 + V, 60 + k + U / 2], axis=-1).astype(np.uint8)
    for k in range(N)
]
each_modality = pytest.mark.parametrize(("modality", "frames"), [("rgb", RGB), ("depth", DEPTH)])


def write(path, modality, frames, **options):
    with VideoWriter(path, [modality], W, H, 15.0, **options) as writer:
        for frame in frames:
            writer.write({modality: frame})
    return path


@each_modality
def test_frames_come_back_whatever_is_sought(tmp_path, modality, frames):
    """Depth to the bit, colours nearly; the same frames are the same bytes."""
    path = write(tmp_path / "v", modality, frames, comment="{}")
    assert path.read_bytes() == write(tmp_path / "again", modality, frames, comment="{}").read_bytes()
    in_order, video = list(Video(path)), Video(path)
    assert len(in_order) == len(video) == N
    for a, b in zip(in_order, frames, strict=True):
        error = np.mean((a.astype(float) - b.astype(float)) ** 2)
        assert error < 255**2 / 1e3 if modality == "rgb" else error == 0.0
    for k in (0, 39, 14, 15, 16, 31, 30, 29, 7, 8, -1):
        assert np.array_equal(video[k], in_order[k])
    assert len(video[10:13]) == 3
    with pytest.raises(IndexError, match="has 40 frames"):
        video[40]


def test_colours_are_converted_as_the_field_does():
    """BT.601 in limited range: brightness as FFmpeg has it, to its rounding, chroma to half a level."""
    draw = np.random.default_rng(0)
    colours = draw.integers(0, 256, (H * W // 16, 3))
    colours[:8] = [[a, b, c] for a in (0, 255) for b in (0, 255) for c in (0, 255)]
    blocks = colours.astype(np.uint8).reshape(H // 4, W // 4, 3)
    picture = np.repeat(np.repeat(blocks, 4, axis=0), 4, axis=1)
    mine = _frame("rgb", picture).to_ndarray().astype(int)
    theirs = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuv420p").to_ndarray().astype(int)
    assert np.abs(mine[:H] - theirs[:H]).max() <= 1
    red, green, blue = (blocks[..., k].astype(float) for k in range(3))
    u = 128 + (-37.797 * red - 74.203 * green + 112.0 * blue) / 255
    v = 128 + (112.0 * red - 93.786 * green - 18.214 * blue) / 255
    chroma = mine[H:].reshape(2, H // 2, W // 2)
    assert np.abs(chroma - np.repeat(np.repeat([u, v], 2, axis=1), 2, axis=2)).max() < 0.6


def test_chroma_is_the_mean_of_four_pixels():
    picture, whole = np.zeros((2, 2, 4, 3), np.uint8)
    picture[0, 0] = picture[1, 1] = (255, 0, 0)
    whole[:, :2] = (128, 0, 0)
    halves, mean = (_frame("rgb", p).to_ndarray().astype(int)[2:] for p in (picture, whole))
    assert np.abs(halves - mean).max() <= 1
    assert halves.max() > 140


@pytest.mark.parametrize(
    ("modality", "shape", "kind"),
    [
        ("rgb", (8, 8), np.uint8), ("rgb", (8, 7, 3), np.uint8), ("rgb", (8, 8, 3), np.uint16),
        ("depth", (8, 8), np.float32), ("depth", (8, 8, 1), np.uint16),
    ],
)  # fmt: skip
def test_what_is_no_frame_is_refused(modality, shape, kind):
    with pytest.raises(ValueError, match=r"are|is"):
        _frame(modality, np.zeros(shape, kind))


def test_opencv_reads_depth_with_conversion_off(tmp_path):
    capture = cv2.VideoCapture(str(write(tmp_path / "d.mkv", "depth", DEPTH)))
    capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    for frame in DEPTH[:5]:
        read, image = capture.read()
        assert read
        assert np.array_equal(image.view(np.uint16).reshape(H, W), frame)


@given(st.floats(0.1, MAX_DEPTH_M), st.sampled_from([0.0, 0.001, 0.005, 0.1]))
@example(0.001, 0.0)
def test_depth_is_stored_to_half_a_step(depth, step):
    """Half a step, and half a millimetre, and what float32 loses: together, where both fall the same way."""
    stored = to_stored(np.array([depth], dtype=np.float32), step)
    assert stored[0] > 0
    assert to_metres(stored, step)[0] == pytest.approx(depth, abs=0.51 * step * depth + 5.1e-4)


@pytest.mark.parametrize("step", [0.0, 0.005])
def test_nothing_within_range_is_zero_and_comes_back_as_infinity(step):
    stored = to_stored(np.array([np.inf, np.nan, -1.0, 65.5356, 1e9, 0.1, 0.2, 1.0, 65.535]), step)
    assert stored[:5].tolist() == [0] * 5
    assert (np.diff(stored[5:].astype(int)) > 0).all()
    assert np.isinf(to_metres(stored, step)).tolist() == [True] * 5 + [False] * 4


def test_a_recording_has_all_its_videos_or_is_refused_by_name(tmp_path):
    for view in ("front", "down"):
        write(tmp_path / f"{view}_rgb.mp4", "rgb", RGB, comment=json.dumps({"view": view}))
        write(tmp_path / f"{view}_depth.mkv", "depth", DEPTH)
    recording = read_recording(tmp_path)
    assert len(recording) == N
    assert recording.fps == 15.0
    assert recording.cameras["down"] == {"view": "down"}
    assert recording.rgb["front"][3].shape == (H, W, 3)
    assert recording.depth_m["down"][3].dtype == np.float32
    assert recording.depth_m["down"][2:4][1] == pytest.approx(to_metres(DEPTH[3]))

    path = tmp_path / "front_rgb.mp4"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(RenderError, match=r"front_rgb\.mp4"):
        Video(path)
    path.unlink()
    with pytest.raises(RenderError, match="no complete recording"):
        read_recording(tmp_path)
