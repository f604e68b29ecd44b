"""Reads a dataset with LeRobot's own class, in whatever Python has LeRobot; writes what it gives as one .npz.

    python tests/support/read_by_lerobot.py FOLDER OUT.npz

No module of aerialdojo_gen is used here: LeRobot wants other versions of many packages.
"""

import json
import os
import sys

os.environ["HF_HUB_OFFLINE"] = "1"

import numpy as np
import torch


def main(folder: str, out: str) -> None:
    try:
        from lerobot.datasets import LeRobotDataset
    except ImportError:
        from lerobot.datasets.lerobot_dataset import LeRobotDataset
    import lerobot

    options = {"video_backend": "pyav"}
    try:
        data = LeRobotDataset("local/aerialdojo", root=folder, depth_output_unit="m", **options)
    except TypeError:
        # Before 0.6 there was no depth.
        data = LeRobotDataset("local/aerialdojo", root=folder, **options)
    meta = data.meta
    arrays: dict[str, list[np.ndarray]] = {}
    told = {
        "version": lerobot.__version__, "frames": len(data), "episodes": meta.total_episodes, "fps": meta.fps,
        "cameras": list(meta.camera_keys), "depth": list(getattr(meta, "depth_keys", [])), "tasks": [],
        "lengths": [int(n) for n in meta.episodes["length"]], "nav_id": list(meta.episodes["nav_id"]),
        "stats": {key: {name: np.asarray(v).tolist() for name, v in of.items()} for key, of in meta.stats.items()},
    }  # fmt: skip
    for k in range(0, len(data), 4):
        item = data[k]
        told["tasks"].append(item.pop("task"))
        for name, value in item.items():
            arrays.setdefault(name, []).append(np.asarray(value))
    # Two steps at a time, as a policy that looks back asks for them; and in batches, by torch's loader.
    camera = meta.camera_keys[0]
    back = {camera: [-1 / meta.fps, 0.0], "action": [0.0, 1 / meta.fps]}
    window = LeRobotDataset("local/aerialdojo", root=folder, delta_timestamps=back, **options)
    at = meta.episodes[0]["dataset_to_index"] - 1
    arrays["window"] = [window[at][camera].numpy()]
    arrays["window_action"], arrays["window_pad"] = (
        [window[at]["action"].numpy()],
        [window[at]["action_is_pad"].numpy()],
    )
    batch = next(iter(torch.utils.data.DataLoader(data, batch_size=5)))
    told["batch"] = {name: list(value.shape) for name, value in batch.items() if hasattr(value, "shape")}
    one = LeRobotDataset("local/aerialdojo", root=folder, episodes=[meta.total_episodes - 1], **options)
    told["last_alone"] = len(one)
    told["last_state"] = one[0]["observation.state"].tolist()
    np.savez(out, told=json.dumps(told), **{name: np.stack(values) for name, values in arrays.items()})


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
