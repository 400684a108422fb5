"""Pictures of labelled cameras with the rows of a table that are of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import pyarrow as pa
from numpy.typing import NDArray

from carstage.dataset.reading import Episode
from carstage.dataset.saved_frames import RowsByFrame
from carstage.errors import DatasetError
from carstage.sensor_kinds.model import COLOUR


class LabelledPicture(NamedTuple):
    """A picture and its rows.

    Attributes:
        place: the camera and the frame, for a caption.
        image: ``(H, W, 3)`` uint8 RGB.
        rows: of the table.
    """

    place: str
    image: NDArray[Any]
    rows: list[dict[str, Any]]


def labelled_pictures(
    episode: Episode, frames: Sequence[int], table: pa.Table
) -> Iterator[LabelledPicture]:
    """The labelled cameras' pictures of some frames.

    Args:
        episode: the episode.
        frames: numbers of the frames.
        table: with columns ``k`` and ``sensor_id``.
    """
    rows_of = RowsByFrame(table)
    for sensor in episode.sensors:
        if not sensor.calibration.labelled or sensor.content != COLOUR:
            continue
        for k in frames:
            rows = [row for row in rows_of.rows(k) if row["sensor_id"] == sensor.id]
            try:
                image = sensor.read(k)
            except DatasetError:
                continue  # the validation reports it
            yield LabelledPicture(f"{sensor.id}, frame {k}", image, rows)
