"""Every table of the store: its columns with unit and meaning, and its primary key."""

from aerialdojo_gen.base.constants import (
    ACTION_NAMES,
    APPROACH,
    DIRECTIONS,
    FAMILIES,
    MOVE_DOWN_1,
    MOVE_UP_1,
    OUTCOMES,
    SETTINGS,
    STOP,
    SUBSETS,
    TERMINATIONS,
    TURN_LEFT,
    TURN_RIGHT,
    VIEWS,
)
from aerialdojo_gen.store.schemas.benchmark import EPISODES, FAILURES, STEPS, TIMINGS
from aerialdojo_gen.store.schemas.columns import TableSpec
from aerialdojo_gen.store.schemas.recordings import FRAMES, RECORDINGS
from aerialdojo_gen.store.schemas.release import (
    RELEASE_ANCHORS,
    RELEASE_OBJECTS,
    ROUTES,
    TASKS,
    TOLD_OF_DIFFICULTY,
    TOLD_OF_SPLITS,
)
from aerialdojo_gen.store.schemas.staged import (
    ANCHORS,
    CHOSEN_ANCHORS,
    LANDMARKS,
    OBJECTS,
    PAIRS,
    PLANS,
    REFERENCES,
    SCENES,
    STAGED,
    VERDICTS,
    VIEWPOINTS,
)

# Tables that stages write for each other, by name.
TABLES = {table.name: table for table in (*STAGED, RECORDINGS, FRAMES)}

__all__ = [
    "ACTION_NAMES",
    "ANCHORS",
    "APPROACH",
    "CHOSEN_ANCHORS",
    "DIRECTIONS",
    "EPISODES",
    "FAILURES",
    "FAMILIES",
    "FRAMES",
    "LANDMARKS",
    "MOVE_DOWN_1",
    "MOVE_UP_1",
    "OBJECTS",
    "OUTCOMES",
    "PAIRS",
    "PLANS",
    "RECORDINGS",
    "REFERENCES",
    "RELEASE_ANCHORS",
    "RELEASE_OBJECTS",
    "ROUTES",
    "SCENES",
    "SETTINGS",
    "STEPS",
    "STOP",
    "SUBSETS",
    "TABLES",
    "TASKS",
    "TERMINATIONS",
    "TIMINGS",
    "TOLD_OF_DIFFICULTY",
    "TOLD_OF_SPLITS",
    "TURN_LEFT",
    "TURN_RIGHT",
    "VERDICTS",
    "VIEWPOINTS",
    "VIEWS",
    "TableSpec",
]
