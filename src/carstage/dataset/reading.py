"""An episode and its sensors, read lazily from their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from carstage.birds_eye import BirdsEye
from carstage.codecs import codec_for
from carstage.dataset.calibration import Calibration, SensorCalibration, calibration_of
from carstage.dataset.disparity import read_disparity_steps
from carstage.dataset.documents import read_document
from carstage.dataset.maps import map_path, read_map, read_vector_map, vector_map_table
from carstage.dataset.messages import message_table
from carstage.dataset.querying import EpisodeTables
from carstage.dataset.saved_frames import Damage, EpisodeFrames, Frame
from carstage.dataset.surroundings import read_birds_eye, read_occupancy
from carstage.dataset.tables import read_table, require_columns, row_sensor
from carstage.errors import BadInputError, DatasetError, StoreAccessError
from carstage.files.bounded import read_bounded
from carstage.geometry import GeoFrame, pose_matrix
from carstage.geometry.stereo import STEPS_PER_PX, CameraPair
from carstage.occupancy import Occupancy
from carstage.plan.stereo import planned_pairs
from carstage.spec import EpisodeSpec, SpecError, is_agent_name
from carstage.storage.marker import CommitMarker, FileEntry
from carstage.storage.names import AGENTS, agent_folder
from carstage.storage.remote_path import DatasetPath
from carstage.vector_map import VectorMap

EPISODE_FORMAT = 1
CALIBRATION_FORMAT = 1
_POSES = "sensor_poses.parquet"


class Sensor:
    """The data of one sensor of one episode.

    Args:
        folder: the episode's.
        calibration: the sensor's.
        poses: gives the sensor's poses by frame; asked for sensors that are not on the ego.
    """

    def __init__(
        self,
        folder: DatasetPath,
        calibration: SensorCalibration,
        poses: Callable[[str], Mapping[int, NDArray[np.float64]]],
    ) -> None:
        self.calibration = calibration
        self._folder = folder
        self._poses = poses
        self._row_kind = row_sensor(calibration.kind)
        named = calibration.kind, calibration.codec
        self._codec = None if self._row_kind else codec_for(*named)[1]

    @property
    def id(self) -> str:
        """The user's name of it."""
        return self.calibration.id

    @property
    def kind(self) -> str:
        """Short name of its kind, such as ``rgb``."""
        return self.calibration.kind

    @property
    def content(self) -> str:
        """What a frame is, as the table of sensor kinds has it."""
        return self.calibration.content

    def calibration_at(self, k: int) -> SensorCalibration:
        """The calibration with ``ego_from_sensor`` as it was in frame ``k``.

        Raises:
            DatasetError: ``sensor_poses.parquet`` has no row of it.
        """
        if self.calibration.on_ego:
            return self.calibration
        pose = self._poses(self.id).get(k)
        if pose is None:
            raise DatasetError(f"sensor_poses.parquet has no row of {self.id} in frame {k}.")
        return replace(self.calibration, ego_from_sensor=pose)

    def paths(self, k: int) -> tuple[DatasetPath, ...]:
        """The files of frame ``k``; of a row-wise sensor the table that holds it."""
        return tuple(self._folder / name for name in self.file_names(k))

    def file_names(self, k: int) -> tuple[str, ...]:
        """Paths of :meth:`paths` below the episode, as the commit marker lists them."""
        if self._codec is None:
            return (f"sensors/{self.id}.parquet",)
        return tuple(f"sensors/{self.id}/{k:06d}{suffix}" for suffix in self._codec.suffixes)

    def read(self, k: int) -> NDArray[Any]:
        """The data of frame ``k``; the array may be read-only.

        Returns:
            ``rgb`` ``(H, W, 3)`` uint8; ``depth`` ``(H, W)`` float32, metres along the optical
            axis; ``semantic`` ``(H, W)`` uint8 tags; ``instance`` ``(H, W, 2)`` uint16 id, tag;
            ``flow`` ``(H, W, 2)`` float32 pixels right and down since the step before;
            ``normals`` ``(H, W, 3)`` uint8; ``lidar`` ``(N, 4)`` float32 x, y, z, intensity;
            ``semantic_lidar`` ``(N,)`` of ``SEMANTIC_POINT``; ``radar`` ``(N, 4)`` float32,
            ``imu`` ``(7,)``, ``gnss`` ``(3,)`` and ``v2x`` ``(N, 15)`` float64 in the order of
            their columns.

        Raises:
            DatasetError: the frame is missing or damaged.
            StoreAccessError: the object store lets nobody look.
        """
        if self._codec is None:
            return self._row(k)
        try:
            return self.decode([read_bounded(path) for path in self.paths(k)])
        except StoreAccessError:  # a ValueError, too; it says nothing of the frame
            raise
        except FileNotFoundError as error:
            raise DatasetError(f"Sensor {self.id} has no frame {k}: {error.filename}.") from error
        except (OSError, ValueError) as error:
            raise DatasetError(f"Sensor {self.id}, frame {k} is damaged: {error}.") from error

    def decode(self, contents: list[bytes]) -> NDArray[Any]:
        """The array of the contents of ``paths(k)``.

        Raises:
            ValueError: damaged content, or the sensor has no files of its own per frame.
        """
        if self._codec is None:
            raise ValueError(f"sensor {self.id} has no files per frame")
        return self._codec.decode(contents)

    @cached_property
    def table(self) -> pa.Table:
        """All frames of a sensor whose frames are rows.

        Raises:
            DatasetError: the sensor has no table, or it is damaged.
        """
        if self._codec is not None:
            raise DatasetError(f"Sensor {self.id} of kind {self.kind} has files, not a table.")
        return read_table(self.paths(0)[0])

    def _row(self, k: int) -> NDArray[Any]:
        assert self._row_kind is not None
        table = self.table
        rows = np.flatnonzero(table["k"].to_numpy() == k)
        if len(rows) != 1:
            raise DatasetError(f"Sensor {self.id} has {len(rows)} rows for frame {k}.")
        row = table.slice(int(rows[0]), 1).to_pylist()[0]
        return self._row_kind.array(row)


class Episode:
    """One committed episode; nothing is read before it is asked for.

    Args:
        folder: its attempt's, or an agent's below it.
        marker: what was committed.
        agent: name of the agent beside the ego as whose the episode is read: sensors, labels and
            ego motion are its own; see :meth:`agent`.

    Attributes:
        agent_damage: by agent, what of its data has to be taken for missing; empty unless set.
    """

    def __init__(self, folder: DatasetPath, marker: CommitMarker, agent: str | None = None) -> None:
        self.folder = folder
        self.marker = marker
        self.agent_name = agent
        self._attempt_folder = folder if agent is None else folder.parents[1]
        self.agent_damage: Mapping[str, Damage] = {}
        self._agent_frames: dict[str, EpisodeFrames] = {}
        self._sensors: dict[str, Sensor] = {}

    @property
    def id(self) -> str:
        """Hash of its spec, see ``docs/formats/run-folder.md``."""
        return self.marker.episode_id

    @property
    def variant(self) -> str | None:
        """Name of the variant that it is; ``None``: the episode has no variants."""
        return None if self.spec.variant is None else self.spec.variant.name

    @property
    def base_id(self) -> str:
        """What the variants of an episode have in common; its own id where it has none."""
        return self.id if self.spec.variant is None else self.spec.variant.base_id

    @property
    def agents(self) -> tuple[str, ...]:
        """Names of the agents beside the ego, in the order of the configuration; often none."""
        return tuple(agent.name for agent in self.spec.agents)

    def agent(self, name: str) -> Episode:
        """The same episode with an agent in the ego's place: its sensors, labels and motion.

        Raises:
            BadInputError: the episode has no agent of that name.
        """
        if name not in self.agents:
            known = ", ".join(self.agents) or "none"
            raise BadInputError(f"Episode {self.id} has no agent {name!r}.", f"Agents: {known}.")
        prefix = f"{agent_folder(name)}/"
        files = tuple(
            replace(entry, path=entry.path.removeprefix(prefix))
            for entry in self.marker.files
            if entry.path.startswith(prefix)
        )
        folder = self._attempt_folder / agent_folder(name)
        return Episode(folder, replace(self.marker, files=files), name)

    @property
    def views(self) -> tuple[Episode, ...]:
        """The episode as the ego's, then as each agent's."""
        return (self, *map(self.agent, self.agents))

    def agent_frame(self, name: str, k: int) -> Frame:
        """Frame ``k`` as an agent's; its tables are kept.

        Raises:
            BadInputError: the episode has no agent of that name.
            DatasetError: a table is missing or damaged.
        """
        if name not in self._agent_frames:
            damage = self.agent_damage.get(name, frozenset())
            self._agent_frames[name] = EpisodeFrames(self.agent(name), damage)
        return self._agent_frames[name].frame(k)

    @property
    def files(self) -> tuple[FileEntry, ...]:
        """The committed files, without those of agents; names are relative to ``folder``."""
        return tuple(f for f in self.marker.files if not f.path.startswith(f"{AGENTS}/"))

    @property
    def frames(self) -> int:
        """Number of saved frames; their index ``k`` counts from 0."""
        return self.marker.frames

    @cached_property
    def document(self) -> Mapping[str, Any]:
        """The content of ``episode.json``."""
        return read_document(self.folder / "episode.json", EPISODE_FORMAT)

    @cached_property
    def spec(self) -> EpisodeSpec:
        """What was asked for.

        Raises:
            DatasetError: ``episode.json`` is missing or damaged.
        """
        try:
            return EpisodeSpec.from_json(self.document["spec"])
        except (KeyError, SpecError) as error:
            raise DatasetError(f"{self.folder / 'episode.json'} is damaged: {error}.") from error

    @cached_property
    def geo_frame(self) -> GeoFrame:
        """How the map lies on the globe, and how the server's GNSS sensors count.

        Raises:
            DatasetError: ``episode.json`` is missing or damaged.
        """
        document = self.document
        try:
            return GeoFrame.from_json(document["geo_reference"])
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise DatasetError(f"{self.folder / 'episode.json'} is damaged: {error}.") from error

    @property
    def map_file(self) -> DatasetPath | None:
        """The file with the town's OpenDRIVE text; ``None`` where it was not recorded.

        Raises:
            DatasetError: ``episode.json`` is missing or damaged.
        """
        return map_path(self._attempt_folder, self.document, "xodr")

    def opendrive(self) -> str | None:
        """The town's OpenDRIVE text as the server gave it; ``None`` where it was not recorded.

        Raises:
            DatasetError: ``episode.json`` is damaged, or the text is missing or damaged.
        """
        content = read_map(self._attempt_folder, self.document, "xodr")
        try:
            return None if content is None else content.decode()
        except UnicodeDecodeError as error:
            raise DatasetError(f"{self.map_file} is damaged: {error}.") from error

    @property
    def vector_map_file(self) -> DatasetPath | None:
        """The town's vector map, GeoParquet; ``None`` where there is none."""
        return map_path(self._attempt_folder, self.document, "parquet")

    def vector_map_table(self) -> pa.Table | None:
        """:meth:`vector_map` as the table that is stored, which raises the same."""
        return vector_map_table(self._attempt_folder, self.document)

    def vector_map(self) -> VectorMap | None:
        """The town's lanes, markings, junctions, crosswalks, stop lines and signals.

        ``None`` where there is none; ``document["vector_map_problem"]`` may say why.

        Raises:
            DatasetError: ``episode.json`` is damaged, or the map is missing or damaged.
        """
        return read_vector_map(self._attempt_folder, self.document)

    def birds_eye(self, k: int) -> BirdsEye | None:
        """The bird's-eye grids of frame ``k``; ``None`` where none were asked for.

        Raises:
            DatasetError: the file is missing or damaged.
        """
        return None if self.spec.labels.birds_eye is None else read_birds_eye(self.folder, k)

    def stereo_pairs(self) -> tuple[CameraPair, ...]:
        """Labelled cameras that are rectified stereo pairs, each with its baseline (m)."""
        return planned_pairs(self.spec.sensors)

    def disparity(self, camera: str, k: int) -> NDArray[np.float32] | None:
        """Disparity of a camera's picture of frame ``k``; ``None`` where there is none of it.

        ``(H, W)`` px, NaN where there is none to be stored. A point at column ``u`` of the left
        picture lies at ``u`` less its disparity in the right one, and the other way round at ``u``
        more.

        Args:
            camera: one of a pair, left or right.
            k: the frame.

        Raises:
            DatasetError: the file is missing or damaged.
        """
        paired = {one.id for pair in self.stereo_pairs() for one in (pair.left, pair.right)}
        if not self.spec.labels.disparity or camera not in paired:
            return None
        steps = read_disparity_steps(self.folder, camera, k)
        found = steps.astype(np.float32) / np.float32(STEPS_PER_PX)
        found[steps == 0] = np.nan
        return found

    def occupancy(self, k: int) -> Occupancy | None:
        """The voxels of frame ``k``; as :meth:`birds_eye`."""
        return None if self.spec.labels.occupancy is None else read_occupancy(self.folder, k)

    @cached_property
    def calibration(self) -> Calibration:
        """The rig: poses, intrinsics, attributes.

        Raises:
            DatasetError: ``calibration.json`` is missing or damaged.
        """
        path = self.folder / "calibration.json"
        document = read_document(path, CALIBRATION_FORMAT)
        try:
            return Calibration(
                {key: tuple(value) for key, value in document["ego_box"].items()},
                {name: calibration_of(name, entry) for name, entry in document["sensors"].items()},
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise DatasetError(f"{path} is damaged: {error!r}.") from error

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """All sensors in the order of the spec."""
        return tuple(self.sensor(name) for name in self.calibration.sensors)

    def sensor(self, sensor_id: str) -> Sensor:
        """One sensor.

        Raises:
            BadInputError: the rig has none of that id.
        """
        if sensor_id not in self._sensors:
            known = self.calibration.sensors
            if sensor_id not in known:
                raise BadInputError(
                    f"Episode {self.id} has no sensor {sensor_id!r}.",
                    f"Sensors: {', '.join(known)}.",
                )
            self._sensors[sensor_id] = Sensor(self.folder, known[sensor_id], self._poses_of)
        return self._sensors[sensor_id]

    def sensor_poses(self) -> pa.Table:
        """``sensor_poses.parquet``: one row per frame and sensor."""
        return read_table(self.folder / _POSES)

    def world_from_sensor(self) -> Mapping[str, Mapping[int, NDArray[np.float64]]]:
        """``(4, 4)`` poses on the map, CARLA's axes, by sensor and frame.

        Raises:
            DatasetError: ``sensor_poses.parquet`` is missing or damaged.
        """
        table = self.sensor_poses()
        require_columns(table, ("k", "sensor_id", "location", "rotation_deg"), _POSES)
        rows = table.select(["k", "sensor_id", "location", "rotation_deg"]).to_pylist()
        poses: dict[str, dict[int, NDArray[np.float64]]] = {}
        for row in rows:
            pose = pose_matrix(row["location"], row["rotation_deg"])
            poses.setdefault(row["sensor_id"], {})[row["k"]] = pose
        return poses

    def carriers(self) -> dict[str, int | None]:
        """By sensor, the track that carries it; ``None`` where it stands on the map."""
        table = self.sensor_poses()
        require_columns(table, ("sensor_id", "carrier_track_id"), _POSES)
        columns = (table[name].to_pylist() for name in ("sensor_id", "carrier_track_id"))
        return dict(zip(*columns, strict=True))

    @cached_property
    def _poses(self) -> Mapping[str, Mapping[int, NDArray[np.float64]]]:
        """``ego_from_sensor`` by sensor and frame."""
        poses: dict[str, dict[int, NDArray[np.float64]]] = {}
        columns = ["k", "sensor_id", "ego_from_sensor"]
        for row in self.sensor_poses().select(columns).to_pylist():
            pose = np.array(row["ego_from_sensor"]).reshape(4, 4)
            poses.setdefault(row["sensor_id"], {})[row["k"]] = pose
        return poses

    def _poses_of(self, sensor_id: str) -> Mapping[int, NDArray[np.float64]]:
        return self._poses.get(sensor_id, {})

    def objects(self) -> pa.Table:
        """``objects.parquet``: one row per frame and object."""
        return read_table(self.folder / "objects.parquet")

    def camera_objects(self) -> pa.Table:
        """``camera_objects.parquet``: one row per frame, labelled camera and object in view."""
        return read_table(self.folder / "camera_objects.parquet")

    def ego(self) -> pa.Table:
        """``ego.parquet``: one row per frame; none when ego motion was not asked for."""
        return read_table(self.folder / "ego.parquet")

    def events(self) -> pa.Table | None:
        """``events.parquet``: one row per planned event; ``None`` where none was planned."""
        if not self.spec.scenario.planned_events():
            return None
        return read_table(self.folder / "events.parquet")

    def controls(self) -> pa.Table | None:
        """``controls.parquet``: one row per tick; ``None`` where no driver of its own drove."""
        if self.spec.ego.driver is None:
            return None
        return read_table(self.folder / "controls.parquet")

    def lane_lines(self) -> pa.Table | None:
        """``lane_lines.parquet``: one row per frame, labelled camera and line or area in view.

        ``None`` where none were asked for.
        """
        if not self.spec.labels.lane_lines:
            return None
        return read_table(self.folder / "lane_lines.parquet")

    def messages(self) -> pa.Table | None:
        """The V2X messages that were received, a row each; ``None`` without a V2X sensor.

        See :func:`carstage.dataset.messages.message_table` for the columns.
        """
        return message_table(self.sensors)

    def patches(self) -> pa.Table | None:
        """``patches.parquet``: one row per frame, labelled camera and patch in view.

        ``None`` where the episode has no patches.
        """
        if not self.spec.patches:
            return None
        return read_table(self.folder / "patches.parquet")

    def ledger(self) -> pa.Table:
        """``frames.parquet``: one row per tick."""
        return read_table(self.folder / "frames.parquet")

    @property
    def tables(self) -> EpisodeTables:
        """Where its tables are, for queries in SQL."""
        # Of the marker, so that no document is read.
        parts = [file.path.split("/") for file in self.marker.files]
        agents = {
            below[0]: None
            for first, *below in parts
            if first == AGENTS and len(below) > 1 and is_agent_name(below[0])
        }
        return EpisodeTables(self.folder, self.marker.versions.get("carstage"), tuple(agents))

    def iter_frames(self) -> Iterator[Frame]:
        """The frames one after the other; sensors are read when they are asked for.

        Raises:
            DatasetError: a table is missing or damaged.
        """
        frames = EpisodeFrames(self)
        return (frames.frame(k) for k in range(self.frames))
