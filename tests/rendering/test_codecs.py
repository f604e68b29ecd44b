from __future__ import annotations

import json

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.rendering.codecs import MAX_DEPTH_M, VideoWriter, _frame, to_metres, to_stored
from aerialdojo_gen.rendering.reader import read_recording
from aerialdojo_gen.rendering.video import Video

N, H, W = 40, 96, 128


def depth_frames() -> list[np.ndarray]:
    u, v = np.meshgrid(np.arange(W), np.arange(H))
    return [((u * 499 + v * 331 + k * 1777) % 65536).astype(np.uint16) for k in range(N)]


def rgb_frames() -> list[np.ndarray]:
    u, v = np.meshgrid(np.arange(W), np.arange(H))
    return [
        np.stack([120 + 60 * np.sin((u + 3 * k) / 20), 90 + v, 60 + k + u / 2], axis=-1).astype(np.uint8)
        for k in range(N)
    ]


def write(path, modality, frames, **options):
    with VideoWriter(path, [modality], W, H, 15.0, **options) as writer:
        for frame in frames:
            writer.write({modality: frame})
    return path


def test_depth_comes_back_bit_for_bit(tmp_path):
    frames = depth_frames()
    video = Video(write(tmp_path / "d.mkv", "depth", frames))
    assert len(video) == N
    assert all(np.array_equal(a, b) for a, b in zip(video, frames, strict=True))


def test_rgb_comes_back_close(tmp_path):
    frames = rgb_frames()
    video = Video(write(tmp_path / "c.mp4", "rgb", frames))
    assert len(video) == N
    for a, b in zip(video, frames, strict=True):
        error = np.mean((a.astype(float) - b.astype(float)) ** 2)
        assert 10 * np.log10(255**2 / error) > 30


def test_colours_are_converted_as_the_field_does():
    """BT.601 in limited range: brightness as FFmpeg has it, to its rounding, chroma to half a level."""
    draw = np.random.default_rng(0)
    colours = np.vstack(
        [
            draw.integers(0, 256, (H * W // 16 - 8, 3)),
            [[a, b, c] for a in (0, 255) for b in (0, 255) for c in (0, 255)],
        ]
    )
    blocks = colours.astype(np.uint8).reshape(H // 4, W // 4, 3)
    picture = np.repeat(np.repeat(blocks, 4, axis=0), 4, axis=1)
    mine = _frame("rgb", picture).to_ndarray().astype(int)
    theirs = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuv420p").to_ndarray().astype(int)
    assert np.abs(mine[:H] - theirs[:H]).max() <= 1
    red, green, blue = (blocks[..., k].astype(float) for k in range(3))
    u = 128 + (-37.797 * red - 74.203 * green + 112.0 * blue) / 255
    v = 128 + (112.0 * red - 93.786 * green - 18.214 * blue) / 255
    chroma = mine[H:].reshape(2, H // 2, W // 2)
    assert np.abs(chroma[0] - np.repeat(np.repeat(u, 2, axis=0), 2, axis=1)).max() < 0.6
    assert np.abs(chroma[1] - np.repeat(np.repeat(v, 2, axis=0), 2, axis=1)).max() < 0.6


def test_chroma_is_the_mean_of_four_pixels():
    picture = np.zeros((2, 4, 3), np.uint8)
    picture[0, 0] = picture[1, 1] = (255, 0, 0)
    whole = np.full((2, 4, 3), 0, np.uint8)
    whole[:, :2] = (128, 0, 0)
    halves, mean = (_frame("rgb", p).to_ndarray().astype(int)[2:] for p in (picture, whole))
    assert np.abs(halves - mean).max() <= 1
    assert halves.max() > 140


@pytest.mark.parametrize(
    ("modality", "picture"),
    [
        ("rgb", np.zeros((8, 8), np.uint8)), ("rgb", np.zeros((8, 7, 3), np.uint8)),
        ("rgb", np.zeros((8, 8, 3), np.uint16)), ("depth", np.zeros((8, 8), np.float32)),
        ("depth", np.zeros((8, 8, 1), np.uint16)),
    ],
)  # fmt: skip
def test_what_is_no_frame_is_refused(modality, picture):
    with pytest.raises(ValueError, match=r"are|is"):
        _frame(modality, picture)


@pytest.mark.parametrize(("modality", "frames"), [("rgb", rgb_frames()), ("depth", depth_frames())])
def test_same_frames_same_bytes(tmp_path, modality, frames):
    a, b = (write(tmp_path / f"{k}.video", modality, frames, comment="{}") for k in "ab")
    assert a.read_bytes() == b.read_bytes()


@pytest.mark.parametrize(("modality", "frames"), [("rgb", rgb_frames()), ("depth", depth_frames())])
def test_a_seek_lands_on_the_frame_asked_for(tmp_path, modality, frames):
    path = write(tmp_path / "v", modality, frames)
    in_order = list(Video(path))
    video = Video(path)
    for k in (0, 39, 14, 15, 16, 31, 30, 29, 7, 8, -1):
        assert np.array_equal(video[k], in_order[k])
    assert len(video[10:13]) == 3
    with pytest.raises(IndexError, match="has 40 frames"):
        video[40]


def test_opencv_reads_depth_with_conversion_off(tmp_path):
    frames = depth_frames()
    capture = cv2.VideoCapture(str(write(tmp_path / "d.mkv", "depth", frames)))
    capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    for frame in frames[:5]:
        read, image = capture.read()
        assert read
        assert np.array_equal(image.view(np.uint16).reshape(H, W), frame)


@given(st.floats(0.001, MAX_DEPTH_M))
def test_depth_in_millimetres_is_within_half_of_one(depth):
    assert to_metres(to_stored(np.array([depth])))[0] == pytest.approx(depth, abs=5.1e-4)


@given(st.floats(0.1, MAX_DEPTH_M), st.sampled_from([0.001, 0.005, 0.1]))
def test_depth_in_steps_is_within_half_of_one(depth, step):
    """Half a step, and half a millimetre, and what float32 loses: together, where both fall the same way."""
    stored = to_stored(np.array([depth], dtype=np.float32), step)
    assert stored[0] > 0
    assert to_metres(stored, step)[0] == pytest.approx(depth, abs=0.51 * step * depth + 5.1e-4)


def test_steps_keep_nothing_within_range_and_the_order_of_depths():
    depth = np.array([np.inf, np.nan, -1.0, 65.6, 0.1, 0.2, 1.0, 65.535])
    stored = to_stored(depth, 0.005)
    assert stored[:4].tolist() == [0, 0, 0, 0]
    assert (np.diff(stored[4:].astype(int)) > 0).all()
    assert np.isinf(to_metres(stored, 0.005)).tolist() == [True] * 4 + [False] * 4


def test_nothing_within_range_is_zero_and_comes_back_as_infinity():
    stored = to_stored(np.array([np.inf, np.nan, -1.0, 65.5356, 65.535, 1e9]))
    assert stored.tolist() == [0, 0, 0, 0, 65535, 0]
    assert np.isinf(to_metres(stored)).tolist() == [True, True, True, True, False, True]


def test_a_recording_has_all_its_videos_or_is_refused_by_name(tmp_path):
    for view in ("front", "down"):
        write(tmp_path / f"{view}_rgb.mp4", "rgb", rgb_frames(), comment=json.dumps({"view": view}))
        write(tmp_path / f"{view}_depth.mkv", "depth", depth_frames())
    recording = read_recording(tmp_path)
    assert len(recording) == N
    assert recording.fps == 15.0
    assert recording.cameras["down"] == {"view": "down"}
    assert recording.rgb["front"][3].shape == (H, W, 3)
    assert recording.depth_m["down"][3].dtype == np.float32
    assert recording.depth_m["down"][2:4][1] == pytest.approx(to_metres(depth_frames()[3]))

    (tmp_path / "down_depth.mkv").unlink()
    with pytest.raises(RenderError, match="no complete recording"):
        read_recording(tmp_path)


def test_a_cut_off_file_is_named(tmp_path):
    path = write(tmp_path / "c.mp4", "rgb", rgb_frames())
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(RenderError, match=r"c\.mp4"):
        Video(path)
