"""How near a flight came to its goal anywhere on the way, not only where an action ended.

The paper's OSR is taken at poses; a move of five metres may pass within the radius and end outside it.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.benchmark.metrics import Floats

STEP_COLUMNS = ("task_id", "step", "x_m", "y_m", "z_m", "distance_m")


def swept_distances(episodes: pa.Table, steps: pa.Table) -> Floats:
    """Smallest distance to the goal over the flown segments, (n,) metres.

    A segment and its end distances fix a triangle.
    """
    nearest = np.array(episodes["min_distance_m"].to_numpy(), dtype=np.float64)
    owner = pc.index_in(steps["task_id"], value_set=episodes["task_id"].combine_chunks())
    flown = steps.filter(pc.is_valid(owner))
    if not flown.num_rows:
        return nearest
    index = pc.drop_null(owner).to_numpy()
    order = np.lexsort((flown["step"].to_numpy(), index))
    index = index[order]
    place = np.stack([flown[f"{a}_m"].to_numpy()[order] for a in "xyz"], axis=1)
    distance = flown["distance_m"].to_numpy()[order]
    first = np.concatenate([[True], index[1:] != index[:-1]])
    begun = index[first]
    from_place, from_distance = np.roll(place, 1, axis=0), np.roll(distance, 1)
    from_place[first] = np.stack([episodes[f"start_{a}_m"].to_numpy()[begun] for a in "xyz"], axis=1)
    from_distance[first] = episodes["euclidean_m"].to_numpy()[begun]
    np.minimum.at(nearest, index, _nearest_on_segment(place - from_place, from_distance, distance))
    return nearest


def _nearest_on_segment(way: Floats, begin_m: Floats, end_m: Floats) -> Floats:
    """Return the distance from a point to segments, of which the ways and the distances at both ends are known."""
    length = np.linalg.norm(way, axis=1)
    # How far along the segment the foot of the perpendicular is, by the law of cosines.
    doubled = begin_m**2 + length**2 - end_m**2
    along = np.divide(doubled, 2.0 * length, out=np.zeros_like(length), where=length > 0.0)
    height = np.sqrt(np.maximum(begin_m**2 - along**2, 0.0))
    return np.where((along > 0.0) & (along < length), height, np.minimum(begin_m, end_m))
