"""Trainings that are killed and gone on with."""

import dataclasses
import json
import signal
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

from support.chores import until

from aerialdojo_gen.learning.recipe import Recipe


def recipe_of(text: str, **changed: Any) -> Recipe:
    """A recipe from its file's text, with other values of some sections or keys."""
    given = tomllib.loads(text)
    for key, value in changed.items():
        given[key] = {**given[key], **value} if isinstance(value, dict) else value
    return Recipe.model_validate(given)


def train_here(data: Any, recipe: Recipe, out: Path, cache: Path, **options: Any) -> Any:
    """Train on the CPU, in this process."""
    from aerialdojo_gen.learning.training import train

    return train(data, recipe, out=out, cache=cache, device="cpu", workers=1, **options)


def network(policy: Path) -> Any:
    """The network of a policy's weights."""
    from aerialdojo_gen.learning.policy import read_network

    return read_network(policy)[0].eval()


def rewritten(policy: Path, path: Path, lacking: str | None = None, **said: Any) -> Path:
    """Write weights elsewhere, without tensors of some name, or with something else said of them."""
    from aerialdojo_gen.learning.policy import read_weights, write_weights

    tensors, about, state = read_weights(policy)
    tensors = {name: tensor for name, tensor in tensors.items() if not (lacking and lacking in name)}
    write_weights(path, tensors, dataclasses.replace(about, **said), state)
    return path


def history(folder):
    return [json.loads(line) for line in (folder / "history.jsonl").read_text().splitlines()]


def kill_at_first_checkpoint(recipe, data, out, cache):
    """Start `train` in a process of its own, and kill it as soon as there is a checkpoint."""
    command = [
        sys.executable, "-m", "aerialdojo_gen.cli", "train", str(recipe), "--data", str(data), "--out", str(out),
        "--cache", str(cache), "--device", "cpu", "--workers", "1",
    ]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        until(lambda: (out / "checkpoint.safetensors").is_file() or process.poll() is not None, 300)
        process.send_signal(signal.SIGKILL)
        process.communicate()
    assert process.returncode == -signal.SIGKILL


def assert_same_training(one, two):
    """Two policies have the same weights to the bit, and came by them through the same losses."""
    import torch

    from aerialdojo_gen.learning.policy import read_weights

    first, second = (read_weights(path)[0] for path in (one, two))
    assert first.keys() == second.keys()
    assert all(torch.equal(first[name], second[name]) for name in first)
    losses = [[row["loss"] for row in history(path.parent)] for path in (one, two)]
    assert losses[0] == losses[1]
