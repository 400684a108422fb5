"""One frame of an episode: rows, poses, and what sensors have data of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from carstage.dataset.ledger import recorded_frames, saved_times_s, unlabelled_frames
from carstage.errors import DatasetError
from carstage.geometry import FloatArray, invert_pose, pose_matrix
from carstage.occupancy import Occupancy, occupancy_name
from carstage.plan.stereo import disparity_name
from carstage.storage.remote_path import DatasetPath

if TYPE_CHECKING:
    from carstage.dataset.reading import Episode

Row = Mapping[str, Any]
Damage = frozenset[tuple[str, int]]
"""Names and frames of what is missing or not what was committed.

A name is a sensor's id, or the path of a file of labels below the episode's folder.
"""


@dataclass(frozen=True)
class Frame:
    """One saved frame.

    Attributes:
        episode: whose frame it is.
        k: its index.
        timestamp_s: time since the first frame.
        objects: rows of ``objects.parquet`` by track id, the ego's left out.
        camera_objects: rows of ``camera_objects.parquet`` by camera.
        ego: the row of ``ego.parquet``; ``None`` when ego motion was not asked for.
        sensor_poses: rows of ``sensor_poses.parquet`` by sensor.
        available: ids of the sensors that have whole data of this frame.
        ego_object: the ego's row of ``objects.parquet``; ``None`` without vehicles' labels.
        lost: names of what has to be taken for missing, as in ``Damage``.
        unlabelled: ids of the labelled cameras whose pictures of this frame have no labels, as
            what they are made from did not arrive.
    """

    episode: Episode
    k: int
    timestamp_s: float
    objects: Mapping[int, Row]
    camera_objects: Mapping[str, Sequence[Row]]
    ego: Row | None
    sensor_poses: Mapping[str, Row]
    available: frozenset[str]
    ego_object: Row | None = None
    lost: frozenset[str] = frozenset()
    unlabelled: frozenset[str] = frozenset()

    def has(self, sensor_id: str) -> bool:
        """Whether the sensor has whole data of this frame."""
        return sensor_id in self.available

    def has_labelled(self, camera_id: str) -> bool:
        """Whether there is a picture of the camera, and labels were made for it.

        No rows of ``camera_objects`` then mean that it shows no object.
        """
        if not self.has(camera_id) or camera_id in self.unlabelled:
            return False
        return self.episode.calibration.sensors[camera_id].labelled

    def read(self, sensor_id: str) -> NDArray[Any]:
        """The sensor's data, see ``Sensor.read``."""
        return self.episode.sensor(sensor_id).read(self.k)

    def occupancy(self) -> Occupancy | None:
        """The voxels, see ``Episode.occupancy``; ``None`` also where they are lost."""
        return None if occupancy_name(self.k) in self.lost else self.episode.occupancy(self.k)

    def disparity(self, camera_id: str) -> NDArray[np.float32] | None:
        """A picture's disparity, see ``Episode.disparity``; ``None`` also where it is lost."""
        if disparity_name(camera_id, self.k) in self.lost:
            return None
        return self.episode.disparity(camera_id, self.k)

    def object(self, track_id: int) -> Row | None:
        """An object's row of ``objects.parquet``, also the ego's, which other cameras may show.

        ``None``: the frame has no such object.
        """
        ego = self.ego_object
        if ego is not None and ego["track_id"] == track_id:
            return ego
        return self.objects.get(track_id)

    def as_agent(self, name: str) -> Frame:
        """The same moment as an agent's beside the ego: its sensors, its labels, its motion.

        Raises:
            BadInputError: the episode has no agent of that name.
        """
        return self.episode.agent_frame(name, self.k)

    def ego_from_agent(self, name: str) -> FloatArray:
        """``(4, 4)`` pose of an agent beside the ego, on the ego, CARLA's axes.

        Raises:
            BadInputError: the episode has no agent of that name.
            DatasetError: no table holds one of the poses.
        """
        return invert_pose(self.world_from_ego) @ self.as_agent(name).world_from_ego

    def image_file(self, camera_id: str) -> DatasetPath:
        """The file of a camera's picture."""
        return self.episode.sensor(camera_id).paths(self.k)[0]

    def world_from_sensor(self, sensor_id: str) -> FloatArray:
        """``(4, 4)`` pose in CARLA's world and sensor axes.

        Raises:
            DatasetError: ``sensor_poses.parquet`` has no row of it.
        """
        row = self.sensor_poses.get(sensor_id)
        if row is None:
            raise DatasetError(
                f"sensor_poses.parquet of episode {self.episode.id} has no row of {sensor_id} "
                f"in frame {self.k}."
            )
        return pose_matrix(row["location"], row["rotation_deg"])

    def ego_from_sensor(self, sensor_id: str) -> FloatArray:
        """``(4, 4)`` pose on the ego, CARLA's axes, of this frame."""
        return self.episode.sensor(sensor_id).calibration_at(self.k).ego_from_sensor

    @cached_property
    def world_from_ego(self) -> FloatArray:
        """``(4, 4)`` pose of the ego's pivot, CARLA's axes.

        Raises:
            DatasetError: no table holds it.
        """
        if self.ego is not None:
            return pose_matrix(self.ego["location"], self.ego["rotation_deg"])
        for sensor_id, row in self.sensor_poses.items():
            ego_from_sensor = np.array(row["ego_from_sensor"]).reshape(4, 4)
            return self.world_from_sensor(sensor_id) @ invert_pose(ego_from_sensor)
        raise DatasetError(f"No table of episode {self.episode.id} has the ego in frame {self.k}.")


class EpisodeFrames:
    """Cuts the tables of an episode into frames.

    Args:
        episode: the episode.
        damage: what has to be taken for missing.

    Raises:
        DatasetError: a table is missing or damaged.
    """

    def __init__(self, episode: Episode, damage: Damage = frozenset()) -> None:
        self._episode = episode
        ledger = episode.ledger()
        self._times_s = saved_times_s(ledger)
        self._lost: dict[int, set[str]] = defaultdict(set)
        for name, k in damage:
            self._lost[k].add(name)
        self._recorded: dict[int, set[str]] = defaultdict(set)
        for sensor_id, frames in recorded_frames(episode.calibration.sensors, ledger).items():
            for k in frames:
                if sensor_id not in self._lost[k]:
                    self._recorded[k].add(sensor_id)
        self._unlabelled: dict[int, set[str]] = defaultdict(set)
        for camera_id, frames in unlabelled_frames(ledger).items():
            for k in frames:
                self._unlabelled[k].add(camera_id)
        self._objects = RowsByFrame(episode.objects())
        self._camera_objects = RowsByFrame(episode.camera_objects())
        self._ego = RowsByFrame(episode.ego())
        self._poses = RowsByFrame(episode.sensor_poses())

    def frame(self, k: int) -> Frame:
        """Frame ``k``.

        Raises:
            DatasetError: the ledger has no such frame.
        """
        if k not in self._times_s:
            raise DatasetError(f"The ledger of episode {self._episode.id} has no frame {k}.")
        by_camera: dict[str, list[Row]] = defaultdict(list)
        for row in self._camera_objects.rows(k):
            by_camera[row["sensor_id"]].append(row)
        objects = self._objects.rows(k)
        return Frame(
            episode=self._episode,
            k=k,
            timestamp_s=self._times_s[k],
            objects={row["track_id"]: row for row in objects if not row["is_ego"]},
            camera_objects=dict(by_camera),
            ego=next(iter(self._ego.rows(k)), None),
            sensor_poses={row["sensor_id"]: row for row in self._poses.rows(k)},
            available=frozenset(self._recorded[k]),
            ego_object=next((row for row in objects if row["is_ego"]), None),
            lost=frozenset(self._lost[k]),
            unlabelled=frozenset(self._unlabelled[k]),
        )


class RowsByFrame:
    """A table whose rows of one frame are a slice."""

    def __init__(self, table: pa.Table) -> None:
        ks = table["k"].to_numpy()
        if np.any(ks[1:] < ks[:-1]):
            order = np.argsort(ks, kind="stable")
            table, ks = table.take(order), ks[order]
        self._table, self._ks = table, ks

    def rows(self, k: int) -> list[dict[str, Any]]:
        """The rows of frame ``k``."""
        first, last = np.searchsorted(self._ks, [k, k + 1])
        return self._table.slice(int(first), int(last - first)).to_pylist()
