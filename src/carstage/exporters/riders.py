"""Two-wheelers without the person who rides them, as COCO has them."""

from __future__ import annotations

import numpy as np

from carstage.annotation.rle import encode_mask
from carstage.dataset import decode_mask
from carstage.dataset.saved_frames import Frame, Row
from carstage.exporters.classes import RIDER


def riders_by_vehicle(frame: Frame, camera_id: str) -> dict[int, Row]:
    """The camera's rows of riders that are seen, by the track of their two-wheeler."""
    riders = {}
    for seen in frame.camera_objects.get(camera_id, ()):
        row = frame.objects.get(seen["track_id"])
        if row is not None and row["class"] == RIDER and seen["mask_modal"] is not None:
            riders[row["parent_track_id"]] = seen
    return riders


def without_rider(vehicle: Row, rider: Row, width: int, height: int) -> Row:
    """A two-wheeler's row with mask, modal box and number of pixels of the vehicle alone.

    Args:
        vehicle: its row, whose mask holds the rider too.
        rider: the rider's row.
        width, height: of the image (px).

    Returns:
        The row; mask and box are ``None`` where nothing but the rider is seen.

    Raises:
        DatasetError: a mask is damaged.
    """
    if vehicle["mask_modal"] is None:
        return vehicle
    both = decode_mask(vehicle["mask_modal"], height, width)
    mask = both & ~decode_mask(rider["mask_modal"], height, width)
    y, x = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(x):
        return {**vehicle, "mask_modal": None, "bbox_modal": None, "visible_px": 0}
    x0, y0, x1, y1 = int(x[0]), int(y[0]), int(x[-1]) + 1, int(y[-1]) + 1
    return {
        **vehicle,
        "mask_modal": encode_mask(mask[y0:y1, x0:x1], x0, y0, width, height),
        "bbox_modal": [float(x0), float(y0), float(x1), float(y1)],
        "visible_px": int(mask.sum()),
    }
