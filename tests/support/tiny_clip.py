"""A CLIP of a few bytes, in ONNX files: its embeddings are colours."""

from pathlib import Path

import numpy as np

from aerialdojo_gen.base.config.sections import ClipConfig

WORDS = {"[UNK]": 0, "a": 1, "photo": 2, "of": 3, "red": 4, "blue": 5, "post": 6}


def write_clip(folder: Path) -> ClipConfig:
    """Write a CLIP whose embedding of a picture is its mean colour, and of a text what its words stand for."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    def save(name, graph):
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        onnx.checker.check_model(model)
        onnx.save(model, str(folder / name))

    value = helper.make_tensor_value_info
    save(
        "vision.onnx",
        helper.make_graph(
            [helper.make_node("ReduceMean", ["pixel_values"], ["image_embeds"], axes=[2, 3], keepdims=0)],
            "vision",
            [value("pixel_values", TensorProto.FLOAT, ["n", 3, 32, 32])],
            [value("image_embeds", TensorProto.FLOAT, ["n", 3])],
        ),
    )
    meaning = np.zeros((len(WORDS), 3), np.float32)
    meaning[WORDS["red"]], meaning[WORDS["blue"]] = (1.0, -0.5, -0.5), (-0.5, -0.5, 1.0)
    save(
        "text.onnx",
        helper.make_graph(
            [
                helper.make_node("Gather", ["meaning", "input_ids"], ["words"]),
                helper.make_node("ReduceSum", ["words", "axes"], ["text_embeds"], keepdims=0),
            ],
            "text",
            [value("input_ids", TensorProto.INT64, ["n", "length"])],
            [value("text_embeds", TensorProto.FLOAT, ["n", 3])],
            [numpy_helper.from_array(meaning, "meaning"), numpy_helper.from_array(np.array([1], np.int64), "axes")],
        ),
    )
    from tokenizers import Tokenizer, models, pre_tokenizers

    tokenizer = Tokenizer(models.WordLevel(WORDS, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    tokenizer.save(str(folder / "tokenizer.json"))
    return ClipConfig(vision=folder / "vision.onnx", text=folder / "text.onnx", tokenizer=folder / "tokenizer.json")
