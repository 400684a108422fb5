"""Which rows of the label tables belong to one actor for as long as it is there."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray


def may_come_back(objects: pa.Table) -> NDArray[np.bool_]:
    """``(N,)`` which rows are of level objects and riders."""
    riders = pa.array(["rider"])  # made here: the first array may import pandas
    static = objects["is_static"].to_numpy()
    return np.asarray(static | pc.is_in(objects["class"], value_set=riders).to_numpy())
