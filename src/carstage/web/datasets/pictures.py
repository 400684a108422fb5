"""Pictures, masks and points of a frame, as the page shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.errors import DatasetError
from carstage.files.bounded import read_bounded
from carstage.sensor_kinds.model import CAMERAS, CLOUDS, COLOUR, DETECTIONS
from carstage.web.datasets.frame_values import FrameService
from carstage.web.errors import not_found
from carstage.web.media import Media

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from carstage.dataset import Frame, Sensor

_PNG, _JPEG, _BYTES = "image/png", "image/jpeg", "application/octet-stream"
_MASK_ALPHA = 150
_AS_IT_IS = 1.5
"""Colour pictures up to so many times as wide as asked go out as they are: they are sent and drawn
sooner than made smaller.
"""


class Pictures:
    """Draws what is asked for; colour pictures in their own size go out as they are.

    Args:
        frames: finds the frames.
    """

    def __init__(self, frames: FrameService) -> None:
        self._frames = frames

    def image(self, dataset: str, episode: str, sensor_id: str, k: int, width: int | None) -> Media:
        """A camera's picture.

        Raises:
            WebError: there is none.
            DatasetError: the file is damaged.
        """
        from carstage.report.drawing import camera_view
        from carstage.web.preview.sensor_views import PALETTE, jpeg, png, scaled

        frame = self._frames.frame(dataset, episode, k)
        sensor = _sensor(frame, sensor_id, CAMERAS)
        most = width if width is None or sensor.content != COLOUR else width * _AS_IT_IS
        small = most is not None and most < sensor.calibration.width
        if sensor.content == COLOUR and not small:
            path = sensor.paths(k)[0]
            try:
                return Media(read_bounded(path), _JPEG if path.suffix == ".jpg" else _PNG)
            except OSError as error:
                raise DatasetError(f"{path.name} cannot be read: {error.strerror}.") from error
        drawn = camera_view(sensor.content, sensor.read(k), PALETTE)
        if small and width is not None:
            drawn = scaled(drawn, width)
        if sensor.content == COLOUR:
            return Media(jpeg(drawn, 85), _JPEG)
        return Media(png(drawn), _PNG)

    def masks(self, dataset: str, episode: str, sensor_id: str, k: int) -> Media:
        """The masks of a labelled camera's visible objects on a transparent ground.

        Raises:
            WebError: there is no such camera or frame.
            DatasetError: a mask is damaged.
        """
        import numpy as np
        from PIL import Image

        from carstage.dataset import decode_mask
        from carstage.report.drawing import class_colour
        from carstage.web.preview.sensor_views import png

        frame = self._frames.frame(dataset, episode, k)
        camera = _sensor(frame, sensor_id, CAMERAS).calibration
        canvas = np.zeros((camera.height, camera.width, 4), np.uint8)
        rows = frame.camera_objects.get(sensor_id, ())
        for row in sorted(rows, key=lambda row: -row["distance"]):  # the nearest on top
            if row["mask_modal"] is None or not row["visible"]:
                continue
            known = frame.object(row["track_id"])
            colour = class_colour(known["class"] if known else "")
            mask = decode_mask(row["mask_modal"], camera.height, camera.width)
            canvas[mask] = (*colour, _MASK_ALPHA)
        return Media(png(Image.fromarray(canvas)), _PNG)

    def points(self, dataset: str, episode: str, sensor_id: str, k: int, sweeps: int = 1) -> Media:
        """``(N, 4)`` float32 in the ego's axes.

        Args:
            dataset: which dataset.
            episode: which episode.
            sensor_id: a LiDAR or radar.
            k: the frame whose ego they are seen from.
            sweeps: how many frames up to this one are put together, as the ego has moved.

        Raises:
            WebError: there is no such sensor or frame.
            DatasetError: the file is damaged.
        """
        import numpy as np

        from carstage.geometry import invert_pose

        frame = self._frames.frame(dataset, episode, k)
        sensor = _sensor(frame, sensor_id, (*CLOUDS, DETECTIONS))
        parts = [_points(sensor, k, sensor.calibration_at(k).ego_from_sensor)]
        if sweeps > 1:
            ego_from_world = invert_pose(frame.world_from_ego)
            for earlier in range(max(0, k - sweeps + 1), k):
                before = self._frames.frame(dataset, episode, earlier)
                if before.has(sensor_id):
                    pose = ego_from_world @ before.world_from_sensor(sensor_id)
                    parts.append(_points(sensor, earlier, pose))
        return Media(np.concatenate(parts).astype("<f4").tobytes(), _BYTES)


def _points(sensor: Sensor, k: int, pose: NDArray[np.float64]) -> NDArray[np.float32]:
    """``(N, 4)`` points of a frame, moved by a pose."""
    import numpy as np

    from carstage.geometry import transform_points
    from carstage.web.preview.sensor_views import points_of

    points = points_of(sensor.content, sensor.read(k)).copy()
    points[:, :3] = transform_points(pose, points[:, :3].astype(np.float64))
    return points


def _sensor(frame: Frame, sensor_id: str, contents: tuple[str, ...]) -> Sensor:
    """A sensor of such content that has data of the frame.

    Raises:
        WebError: there is none.
    """
    known = frame.episode.calibration.sensors.get(sensor_id)
    if known is None or known.content not in contents:
        raise not_found(f"sensor {sensor_id} that could be shown so")
    if not frame.has(sensor_id):
        raise not_found(f"data of {sensor_id} in frame {frame.k}")
    return frame.episode.sensor(sensor_id)
