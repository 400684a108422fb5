"""Which rows of the label tables belong to one actor for as long as it is there."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

_RIDER = pa.array(["rider"])


def may_come_back(objects: pa.Table) -> NDArray[np.bool_]:
    """``(N,)`` which rows are of level objects and riders."""
    static = objects["is_static"].to_numpy()
    return np.asarray(static | pc.is_in(objects["class"], value_set=_RIDER).to_numpy())
