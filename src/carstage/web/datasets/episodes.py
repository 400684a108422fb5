"""One episode: its rig, its times, the top view."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.web.configure.description import DescriptionService
from carstage.web.datasets.catalogue import Catalogue
from carstage.web.messages import EgoSignals, EpisodeDetail, EpisodeMap, RigSensor

if TYPE_CHECKING:
    from carstage.dataset import SensorCalibration

_MARGIN_M = 60.0
_FINE = ("ok", "off")


class EpisodeService:
    """Episodes with their sensors and maps.

    Args:
        catalogue: finds them.
        description: knows the lanes of the simulator's maps.
    """

    def __init__(self, catalogue: Catalogue, description: DescriptionService) -> None:
        self._catalogue = catalogue
        self._description = description

    def detail(self, dataset: str, episode_id: str) -> EpisodeDetail:
        """Rig, times, what was asked for.

        Raises:
            WebError: there is no such episode.
            DatasetError: a document or table is missing or damaged.
        """
        from carstage.dataset.ledger import saved_times_s

        episode = self._catalogue.episode(dataset, episode_id)
        ledger = episode.ledger()
        states = [ledger[f"{sensor}.state"].to_pylist() for sensor in episode.calibration.sensors]
        incomplete = sum(any(s not in _FINE for s in row) for row in zip(*states, strict=True))
        return EpisodeDetail(
            episode=self._catalogue.numbered(dataset, episode_id),
            sensors=[_sensor(sensor) for sensor in episode.calibration.sensors.values()],
            times_s=list(saved_times_s(ledger).values()),
            ego_box={key: list(value) for key, value in episode.calibration.ego_box.items()},
            incomplete=incomplete,
            requested=dict(episode.document["requested"]),
            spawned=dict(episode.document["spawned"]),
            spec=episode.spec.to_json(),
            tags=self._catalogue.tags(dataset),
        )

    def map(self, dataset: str, episode_id: str) -> EpisodeMap:
        """Lanes and the ego's way.

        Raises:
            WebError: there is no such episode.
            DatasetError: a table is missing or damaged.
        """
        episode = self._catalogue.episode(dataset, episode_id)
        ego = episode.ego().select(["location", "rotation_deg"]).to_pylist()
        track = [[row["location"][0], row["location"][1], row["rotation_deg"][1]] for row in ego]
        if not track:  # no ego motion was asked for: the first sensor on it has the same motion
            poses = episode.world_from_sensor()
            first = next(iter(poses.values()), {})
            track = [[float(pose[0, 3]), float(pose[1, 3]), 0.0] for pose in first.values()]
        xs, ys = [point[0] for point in track] or [0.0], [point[1] for point in track] or [0.0]
        name = episode.spec.map
        lanes = self._description.lanes(name)
        return EpisodeMap(
            map=name,
            lanes=[] if lanes is None else lanes["lanes"],
            lane_widths_m=[] if lanes is None else lanes["widths_m"],
            track=track,
            bounds=[
                min(xs) - _MARGIN_M, min(ys) - _MARGIN_M, max(xs) + _MARGIN_M, max(ys) + _MARGIN_M,
            ],
        )  # fmt: skip

    def ego(self, dataset: str, episode_id: str) -> EgoSignals:
        """Speed, acceleration and steering of the ego.

        Raises:
            WebError: there is no such episode.
            DatasetError: the table is damaged.
        """
        table = self._catalogue.episode(dataset, episode_id).ego()
        rows = table.select(["speed", "acceleration_ego", "steer"]).to_pylist()
        return EgoSignals(
            speed_m_s=[row["speed"] for row in rows],
            acceleration_m_s2=[_forward(row["acceleration_ego"]) for row in rows],
            steer=[row["steer"] for row in rows],
        )


def _forward(vector: list[float] | None) -> float | None:
    """What a vector has along x."""
    return None if vector is None else vector[0]


def _sensor(sensor: SensorCalibration) -> RigSensor:
    from carstage.sensor_kinds import known_kind

    kind = known_kind(sensor.kind)
    return RigSensor(
        id=sensor.id,
        kind=sensor.kind,
        labelled=sensor.labelled,
        width=sensor.width,
        height=sensor.height,
        fov_deg=sensor.fov_deg,
        K=sensor.k.tolist() if sensor.is_camera else None,
        ego_from_sensor=sensor.ego_from_sensor.tolist() if sensor.on_ego else None,
        attach_to=sensor.attach_to,
        data="none" if kind is None else kind.viewer,  # type: ignore[arg-type]
    )
