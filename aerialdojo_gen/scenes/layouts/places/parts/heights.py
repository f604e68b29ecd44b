"""Heights that a recipe states point by point."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.terrain import Terrain

_Height = Annotated[float, Field(ge=-2000, le=2000)]


def _rectangular(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len({len(row) for row in rows}) != 1:
        raise ValueError("the rows of heights must be of one length")
    return rows


Rows = Annotated[
    tuple[Annotated[tuple[_Height, ...], Field(min_length=2, max_length=1000)], ...],
    Field(min_length=2, max_length=1000),
    AfterValidator(_rectangular),
]


class Heights(BaseModel):
    """Heights on a square grid.

    Attributes
    ----------
    cell_m : float
        Distance of neighbouring points, metres.
    rows_m : tuple of tuple of float
        z of the points, metres: rows run north from the southernmost, points east from the westernmost; the grid lies
        with its middle in the origin.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    cell_m: Annotated[float, Field(ge=0.1, le=100)]
    rows_m: Rows

    def terrain(self, size_m: tuple[float, float]) -> Terrain:
        """Make the terrain; an `AssetError` where it is smaller than the site."""
        z = np.asarray(self.rows_m, dtype=np.float64)
        across = (z.shape[1] - 1) * self.cell_m, (z.shape[0] - 1) * self.cell_m
        if across[0] < size_m[0] - 1e-6 or across[1] < size_m[1] - 1e-6:
            raise AssetError(
                f"the heights cover {across[0]:g} by {across[1]:g} m, the site is {size_m[0]:g} by {size_m[1]:g} m"
            )
        return Terrain(-across[0] / 2, -across[1] / 2, self.cell_m, z)
