"""Pictures as files: the settings give the bytes that are stored, and decoding gives back what was encoded."""

import hashlib

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.base.pictures import (
    FRAME_PNG,
    REFERENCE_PNG,
    TEXTURE_PNG,
    Picture,
    decode_as_stored,
    decode_grey,
    decode_rgb,
    encode_jpeg,
    encode_png,
)


def noise(*shape, dtype=np.uint8):
    return np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype)


def test_the_release_holds_what_the_setting_of_reference_images_makes(smoke):
    stored = [
        row
        for path in sorted((smoke / "release/objects").glob("*.parquet"))
        for row in pq.read_table(path, columns=["reference_image", "reference_image_id"]).to_pylist()
        if row["reference_image"]
    ]
    assert len(stored) > 10
    digests = [hashlib.sha256(row["reference_image"]).hexdigest() for row in stored]
    again = [encode_png(decode_rgb(row["reference_image"]), REFERENCE_PNG) for row in stored]
    assert [hashlib.sha256(file).hexdigest() for file in again] == digests


def test_meshes_hold_what_the_setting_of_textures_makes(smoke):
    from aerialdojo_gen.scenes.glb import read_glb, write_glb

    path = sorted((smoke / "meshes").glob("*.glb"))[0]
    again = smoke.parent / "again.glb"
    write_glb(read_glb(path), again)
    assert again.read_bytes() == path.read_bytes()
    again.unlink()


def test_files_are_those_of_opencv(tmp_path):
    """Loose frames were written by imwrite, textures by imencode: the bytes are the same."""
    rgb, depth = noise(30, 40, 3), noise(30, 40, dtype=np.uint16)
    path = tmp_path / "frame.png"
    for image, bgr in ((rgb, np.ascontiguousarray(rgb[..., ::-1])), (depth, depth)):
        cv2.imwrite(str(path), bgr, [cv2.IMWRITE_PNG_COMPRESSION, 4])
        assert encode_png(image, FRAME_PNG) == path.read_bytes()
    # Of noise all settings make the same.
    waves = np.add.outer(np.arange(300) % 17, np.arange(400) % 23).astype(np.uint8)[..., None].repeat(3, axis=2)
    assert encode_png(waves, TEXTURE_PNG) != encode_png(waves, FRAME_PNG)


def test_what_is_decoded_is_what_was_encoded():
    rgb, grey, depth = noise(9, 7, 3), noise(9, 7), noise(9, 7, dtype=np.uint16)
    assert np.array_equal(decode_rgb(encode_png(rgb)), rgb)
    assert np.array_equal(decode_rgb(encode_png(grey)), np.repeat(grey[..., None], 3, axis=2))
    assert np.array_equal(decode_grey(encode_png(grey)), grey)
    for image in (rgb, grey, depth):
        again = decode_as_stored(encode_png(image))
        assert again.dtype == image.dtype
        assert np.array_equal(again, image)
    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 0] = 255
    assert np.abs(decode_rgb(encode_jpeg(red, 90)).astype(int) - red).max() < 8
    assert Picture(encode_png(red)).data_url.startswith("data:image/png;base64,iVBOR")
    assert Picture(encode_jpeg(red, 90)).data_url.startswith("data:image/jpeg;base64,/9j/")


@pytest.mark.parametrize("file", [None, b"", b"no picture", encode_png(noise(9, 7, 3))[:40]])
def test_what_is_no_picture_is_none(file):
    assert decode_rgb(file) is decode_grey(file) is decode_as_stored(file) is None


def test_a_picture_without_pixels_is_refused():
    with pytest.raises(RenderError, match=r"shape \(0, 4, 3\) does not encode as PNG"):
        encode_png(np.zeros((0, 4, 3), np.uint8))
