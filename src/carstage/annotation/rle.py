"""Binary masks as COCO's compressed run lengths.

The format of ``pycocotools``' ``maskApi.c``: run lengths of the column-major image, beginning
with zeros; from the fourth on the difference to the one two before; each as little-endian groups
of five bits plus a continuation bit, offset by 48 into printable ASCII.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def encode_mask(crop: NDArray[np.bool_], x0: int, y0: int, width: int, height: int) -> str:
    """COCO's ``counts`` string of a whole mask of which only a crop is set.

    Args:
        crop: ``(h, w)`` mask; its first pixel is (x0, y0) of the image.
        x0: column of the crop in the image.
        y0: row of the crop in the image.
        width: of the image (px).
        height: of the image (px).
    """
    # Half a second to import, which only processes that count pixels shall need.
    from carstage.annotation.pixel_kernel import encode_runs

    code: NDArray[np.uint8] = encode_runs(crop, x0, y0, width, height)
    return code.tobytes().decode("ascii")
