"""Correspondence of picture and name by a CLIP model in ONNX files that the user names."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError, MissingPackage, no_package
from aerialdojo_gen.pipeline.scoring.base import AnchorView

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import ClipConfig

# CLIP's own preprocessing (Radford et al. 2021, its published code).
_MEAN = np.array([0.48145466, 0.4578275, 0.40821073], np.float32)
_STD = np.array([0.26862954, 0.26130258, 0.27577711], np.float32)
_PROMPT = "a photo of a {}"
# CLIP's learned temperature: similarities are that much further apart before a softmax.
_SHARPNESS = 100.0
_EDGE_PX, _TOKENS = 224, 77


class ClipScorer:
    """A `Scorer` by a picture's fit to the name: the best has 1, others exp(100 · (cosine − the best cosine))."""

    name = "clip"

    def __init__(self, config: ClipConfig) -> None:
        try:
            import onnxruntime
            import tokenizers
        except ImportError as error:
            raise MissingPackage(no_package("the scorer clip", error.name, "clip")) from None
        self._vision = _session(onnxruntime, config.vision)
        self._text = _session(onnxruntime, config.text)
        pictures = [i for i in self._vision.get_inputs() if len(i.shape) == 4]
        if not pictures:
            raise AssetError(f"{config.vision} takes no pictures: none of its inputs has four dimensions")
        self._pixels = pictures[0]
        if "input_ids" not in {i.name for i in self._text.get_inputs()}:
            raise AssetError(f"{config.text} takes no text: it has no input 'input_ids'")
        try:
            self._tokenizer = tokenizers.Tokenizer.from_file(str(config.tokenizer))
        except Exception as error:  # the package raises Exception itself
            raise AssetError(f"cannot read the tokenizer {config.tokenizer}: {error}") from None
        self._known: dict[str, NDArray[np.float64]] = {}

    def score(self, name: str, views: Sequence[AnchorView]) -> list[float | None]:
        """Score views by their likeness to the name."""
        similarity = self.similarity(name, np.stack([view.rgb for view in views]))
        return [float(s) for s in np.exp(_SHARPNESS * (similarity - similarity.max()))]

    def similarity(self, name: str, rgb: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Cosines (n,) between a name's embedding and those of pictures (n, H, W, 3) uint8."""
        if name not in self._known:
            self._known[name] = self.embed_text(_PROMPT.format(name))
        return self.embed_pictures(rgb) @ self._known[name]

    def embed_text(self, text: str) -> NDArray[np.float64]:
        """Embed a text, cut after 77 tokens: (d,), of length 1."""
        self._tokenizer.enable_truncation(_TOKENS)
        encoded = self._tokenizer.encode(text)
        given = {"input_ids": encoded.ids, "attention_mask": encoded.attention_mask}
        feed = {i.name: np.array([given[i.name]], _dtype(i)) for i in self._text.get_inputs() if i.name in given}
        return _unit(_run(self._text, feed, "text_embeds"))[0]

    def embed_pictures(self, rgb: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Embed pictures (n, H, W, 3) uint8: (n, d), rows of length 1."""
        edge = self._pixels.shape[2] if isinstance(self._pixels.shape[2], int) else _EDGE_PX
        scaled = [cv2.resize(picture, (edge, edge), interpolation=cv2.INTER_CUBIC) for picture in rgb]
        pixels = (np.stack(scaled).astype(np.float32) / 255.0 - _MEAN) / _STD
        feed = {self._pixels.name: np.ascontiguousarray(pixels.transpose(0, 3, 1, 2)).astype(_dtype(self._pixels))}
        return _unit(_run(self._vision, feed, "image_embeds"))


def digest(config: ClipConfig) -> str:
    """SHA-256 over the scorer's three files: what it says depends on what is in them, not on their names."""
    whole = hashlib.sha256()
    for path in (config.vision, config.text, config.tokenizer):
        try:
            with path.open("rb") as file:
                whole.update(hashlib.file_digest(file, "sha256").digest())
        except OSError as error:
            raise AssetError(f"the clip scorer cannot read {path}: {error.strerror}") from None
    return whole.hexdigest()


def _session(onnxruntime: Any, path: Path) -> Any:
    if not path.is_file():
        raise AssetError(f"the clip scorer's model {path} does not exist")
    options = onnxruntime.SessionOptions()
    # One thread: sums in another order have other last bits, and scores decide what is selected.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the package's errors have no common parent
        raise AssetError(f"{path} is no ONNX model that onnxruntime can read: {error}") from None


def _run(session: Any, feed: dict[str, NDArray[Any]], output: str) -> NDArray[np.float64]:
    outputs = [o.name for o in session.get_outputs()]
    name = output if output in outputs else outputs[0]
    try:
        return np.asarray(session.run([name], feed)[0], dtype=np.float64)
    except Exception as error:  # as above
        raise AssetError(f"the clip scorer's model does not run: {str(error).splitlines()[0]}") from None


def _unit(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    if rows.ndim != 2:
        raise AssetError(f"the clip scorer's model gives an output of shape {rows.shape}, not one embedding a row")
    return rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-12)


def _dtype(value: Any) -> type[Any]:
    known: dict[str, type[Any]] = {
        "tensor(int32)": np.int32, "tensor(int64)": np.int64, "tensor(float16)": np.float16,
        "tensor(float)": np.float32,
    }  # fmt: skip
    if value.type not in known:
        raise AssetError(f"the clip scorer's model has an input {value.name} of type {value.type}")
    return known[value.type]
