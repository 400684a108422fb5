"""Which cells of a grid a kernel of this package walks.

Kernels only call what lies in their own room (``kernels``), so the maps' grids have their walk
here too.
"""

from __future__ import annotations

import numpy as np

from carstage_sim.kernels import device


@device
def cell_along(value, low, cell_m, count):  # type: ignore[no-untyped-def]
    """The cell of a coordinate along an axis; the one at the edge for what is beyond it, or NaN."""
    position = np.floor((value - low) / cell_m)
    if not position >= 0.0:
        return 0
    return int(min(position, count - 1.0))


@device
def cells_along(grid, axis, low, high):  # type: ignore[no-untyped-def]
    """First and last cell of a grid along an axis from ``low`` to ``high`` (m).

    Args:
        grid: :class:`carstage_sim.maps.cell_index.CellGrid`.
        axis: 0 for x, 1 for y.
    """
    first = cell_along(low, grid.low[axis], grid.cell_m, grid.shape[axis])
    return first, cell_along(high, grid.low[axis], grid.cell_m, grid.shape[axis])
