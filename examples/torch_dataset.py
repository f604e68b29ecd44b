"""Recordings and routes as a PyTorch dataset: a sample a pose, with picture, depth, goal text and the next action.

    python examples/torch_dataset.py data

It needs recordings (`aerialdojo-gen render`), and for batches `pip install torch --index-url
https://download.pytorch.org/whl/cpu`. Without torch, samples are NumPy arrays.
"""

import bisect
import sys
from functools import lru_cache
from itertools import accumulate

import numpy as np

from aerialdojo_gen import open_release

try:
    from torch.utils.data import DataLoader, Dataset
except ImportError:
    DataLoader, Dataset = None, object


class Poses(Dataset):
    """Every recorded pose of a split: what an agent sees there, and what the reference does next.

    Parameters
    ----------
    data : str or Path
        The data directory.
    split : str
        id_train, id_test, ood_train or ood_test.
    view : str
        front, left, right or down.
    """

    def __init__(self, data="data", split="id_train", view="front"):
        self.release, self.view = open_release(data), view
        tasks = self.release.tasks(split=split).to_pandas()
        routes = self.release.routes(split=split).to_pandas().set_index("nav_id")
        recorded = routes.loc[routes.index.intersection(self.release.recorded())].dropna(subset="agent_action")
        # agent_action is action without the Approach, which no agent can choose: pose k of both is frame k.
        self.actions = {nav_id: np.asarray(row) for nav_id, row in recorded["agent_action"].items()}
        self.nav_ids, self.ends = list(self.actions), [*accumulate(map(len, self.actions.values()))]
        goals = tasks[tasks["modality"] == "semantic"].set_index("nav_id")
        self.texts = (goals["target_name"] + ": " + goals["description"]).to_dict()
        self.recording = lru_cache(maxsize=4)(self.release.recording)  # frames are decoded when asked for

    def __len__(self):
        """Return the number of poses."""
        return self.ends[-1] if self.ends else 0

    def __getitem__(self, i):
        """Return pose i: (3, H, W) float32 of 0 to 1, (1, H, W) float32 metres, the goal's text, the action's id."""
        if not 0 <= i < len(self):
            raise IndexError(i)
        at = bisect.bisect_right(self.ends, i)
        nav_id = self.nav_ids[at]
        k = i - (self.ends[at - 1] if at else 0)
        recording = self.recording(nav_id)
        rgb = recording.rgb[self.view][k].transpose(2, 0, 1).astype(np.float32) / 255
        depth_m = recording.depth_m[self.view][k][None].astype(np.float32)
        # Open sky is infinite, which no network likes.
        depth_m = np.where(np.isfinite(depth_m), depth_m, 0).astype(np.float32)
        return {"rgb": rgb, "depth_m": depth_m, "text": self.texts[nav_id], "action": int(self.actions[nav_id][k])}


if __name__ == "__main__":
    poses = Poses(*sys.argv[1:])
    print(f"{len(poses)} poses of {len(poses.nav_ids)} routes")
    for batch in DataLoader(poses, batch_size=8, shuffle=True) if DataLoader else [poses[0]]:
        print({key: getattr(value, "shape", value) for key, value in batch.items()})
        break
