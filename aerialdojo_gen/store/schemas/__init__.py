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
from aerialdojo_gen.store.schemas.release import (
    DIFFICULTY_COLUMNS,
    RELEASE_ANCHORS,
    RELEASE_OBJECTS,
    ROUTES,
    SPLIT_COLUMNS,
    TASKS,
)
from aerialdojo_gen.store.schemas.staged import (
    ANCHORS,
    CHOSEN_ANCHORS,
    DESCRIPTIONS,
    FRAMES,
    LANDMARKS,
    OBJECTS,
    PAIRS,
    PLANS,
    RECORDINGS,
    REFERENCES,
    SCENES,
    STAGED,
    VERDICTS,
    VIEWPOINTS,
    TableSpec,
)

# Tables that stages write for each other, by name.
TABLES = {table.name: table for table in (*STAGED, RECORDINGS, FRAMES)}
