"""The layout in which AerialDojo's authors publish their tasks: its folders, its words."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

SEMANTIC, IMAGE, TRAJECTORIES = "SemanticOGS", "ImageOGS", "TrajectoryDATA"
KINDS = {SEMANTIC: "semantic", IMAGE: "image"}
TASK_FILE = "Task.json"
SCHEMA_VERSION = "hybrid_astar_trajectory_v6"

# Setting: the folder, the letter in the partition's name, the word in the task.
SETTING_WORDS = {
    "base": ("1_BaseTasks", "B", "base_task"),
    "standard": ("2_StandardTasks", "S", "standard_task"),
    "long_horizon": ("3_LongHorizonTasks", "L", "long_task"),
}
SETTING_OF = {words[2]: setting for setting, words in SETTING_WORDS.items()}

# What a task says of its route, and our columns.
INFO = {"geodesic_distance": "length_m", "euclidean_distance": "euclidean_m", "complexity": "detour_ratio"}

# The loader says IID, some documents ID.
_SPLIT = re.compile(r"(I?ID|OOD)_(TRAIN|TEST)S")
_FOLDER = re.compile(r"(.+)_([BSL])_(Train|Test)")


@dataclass(frozen=True)
class Partition:
    """One folder of tasks: a split, a setting and a scene."""

    scene: str  # As in our tables
    setting: str
    partition: str  # ID or OOD; train or test
    subset: str
    split: str  # The name of the split's folder

    @property
    def path(self) -> Path:
        """Its folder below SemanticOGS, ImageOGS and TrajectoryDATA."""
        folder, letter, _ = SETTING_WORDS[self.setting]
        return Path(self.split) / folder / f"{self.scene}_{letter}_{self.subset.capitalize()}"


def partition_of(scene: str, setting: str, partition: str, subset: str) -> Partition:
    """Name the partition of tasks of ours."""
    split = f"{'OOD' if partition == 'OOD' else 'IID'}_{subset.upper()}S"
    return Partition(scene, setting, partition, subset, split)


def parse_partition(folder: Path) -> Partition | None:
    """Read a partition off the last three parts of its path; None where they are none."""
    if len(folder.parts) < 3:
        return None
    split, category, name = folder.parts[-3:]
    is_split, is_name = _SPLIT.fullmatch(split), _FOLDER.fullmatch(name)
    if not is_split or not is_name or is_name[3].upper() != is_split[2]:
        return None
    settings = [setting for setting, words in SETTING_WORDS.items() if words[:2] == (category, is_name[2])]
    part = "OOD" if is_split[1] == "OOD" else "ID"
    return Partition(is_name[1], settings[0], part, is_name[3].lower(), split) if settings else None
