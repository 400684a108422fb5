"""OPV2V, for cooperative perception: a folder for each car and roadside unit, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final

from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.clouds import read_points
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.opv2v_files import frame_document, pcd, write_yaml
from carstage.exporters.formats.pictures import copy_as_png
from carstage.exporters.labels import require_labels
from carstage.exporters.lenses import no_place_for
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import main_lidar
from carstage.exporters.splits import Split
from carstage.exporters.variants import variant_entry
from carstage.sensor_kinds.model import COLOUR

MOST_CAMERAS: Final = 4
PROTOCOL: Final = "data_protocol.yaml"
_MIN_POINTS: Final = 1
_SPLIT_FOLDERS: Final[dict[Split, str]] = {"train": "train", "val": "validate", "test": "test"}


@dataclass(frozen=True, slots=True)
class CooperativeAgent:
    """A car or roadside unit, and what of its rig is exported.

    Attributes:
        name: of the agent; ``None``: the ego.
        folder: its id in the format.
        is_roadside: it is no vehicle.
        lidar: id of its LiDAR.
        cameras: its pictures' cameras, at most four.
    """

    name: str | None
    folder: str
    is_roadside: bool
    lidar: str
    cameras: tuple[SensorCalibration, ...]

    def frame(self, frame: Frame) -> Frame:
        """The frame as this agent's."""
        return frame if self.name is None else frame.as_agent(self.name)


@dataclass(frozen=True, slots=True)
class CooperativeWriter:
    """Writes the files of all agents of a frame.

    Attributes:
        options: the export's.
        agents: the ego first.
        folder: of the scenario, relative to the export's.
    """

    options: ExportOptions
    agents: tuple[CooperativeAgent, ...]
    folder: str

    def __call__(self, frame: Frame, folder: Path) -> bool | None:
        """Write the frame; ``None`` where the LiDAR of one of them has no data of it.

        The reader counts the frames of the first agent and expects them of all.
        """
        frames = [agent.frame(frame) for agent in self.agents]
        if not all(one.has(agent.lidar) for one, agent in zip(frames, self.agents, strict=True)):
            return None
        for agent, one in zip(self.agents, frames, strict=True):
            self._write(agent, one, folder / self.folder / agent.folder / f"{frame.k:06d}")
        return True

    def _write(self, agent: CooperativeAgent, frame: Frame, stem: Path) -> None:
        least = self.options.min_lidar_points
        document = frame_document(
            frame,
            agent.lidar,
            agent.cameras,
            is_roadside=agent.is_roadside,
            min_points=_MIN_POINTS if least is None else least,
            max_distance_m=self.options.max_distance_m,
        )
        write_yaml(stem.with_name(f"{stem.name}.yaml"), document)
        stem.with_name(f"{stem.name}.pcd").write_bytes(pcd(read_points(frame, agent.lidar)))
        for number, camera in enumerate(agent.cameras):
            if frame.has(camera.id):
                copy_as_png(frame, camera.id, stem.with_name(f"{stem.name}_camera{number}.png"))


@register
class Opv2v(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "opv2v"
    summary: ClassVar = "OPV2V (OpenCOOD): a folder for each car and roadside unit of a fleet."
    uses: ClassVar = frozenset(
        {"cameras", "lidar", "min_lidar_points", "max_distance_m", "val_share", "test_share"}
    )
    with_agents: ClassVar = True

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs."""
        for episode in episodes:
            require_labels(episode, self.options, "3d")
            cooperative_agents(episode, self.options)
        self._folder = folder

    def begin_episode(self, episode: Episode) -> CooperativeWriter:
        """Make the scenario's folders and write what it was recorded by."""
        agents = cooperative_agents(episode, self.options)
        scenario = f"{_SPLIT_FOLDERS[self.split_of(episode)]}/{episode.id}"
        for agent in agents:
            (self._folder / scenario / agent.folder).mkdir(parents=True)
        write_yaml(self._folder / scenario / PROTOCOL, protocol_document(episode, agents))
        return CooperativeWriter(self.options, agents, scenario)

    def add(self, part: bool) -> None:
        """Nothing is common to the frames."""

    def end_episode(self) -> None:
        """All of an episode is written with its frames."""

    def finish(self) -> None:
        """Nothing is common to the episodes."""


def cooperative_agents(episode: Episode, options: ExportOptions) -> tuple[CooperativeAgent, ...]:
    """The ego and the agents of an episode, with the ids that OpenCOOD's reader sorts as it should.

    It takes the first id as text for its ego, and moves a negative one, a roadside unit's, behind
    the others.

    Raises:
        BadInputError: one has no LiDAR, a camera that is named has a lens, or there are several
            roadside units.
    """
    views = episode.views
    vehicles = [view for view in views if view.spec.ego.is_vehicle]
    roadside = len(views) - len(vehicles)
    if roadside > 1:
        raise BadInputError(
            f"Episode {episode.id} has {roadside} roadside units; OPV2V's reader takes one.",
            "Choose other episodes with --episode, or record with one.",
        )
    digits = max(len(str(view.document["ego_id"])) for view in vehicles)
    agents = []
    for view in views:
        is_vehicle = view.spec.ego.is_vehicle
        number = int(view.document["ego_id"]) if is_vehicle else -1
        agents.append(_agent(view, f"{number:0{digits}d}" if is_vehicle else "-1", options))
    return tuple(agents)


def protocol_document(episode: Episode, agents: Sequence[CooperativeAgent]) -> dict[str, Any]:
    """What a scenario was recorded by; of OPV2V's own keys, those that have a meaning here."""
    spec = episode.spec
    return {
        "created_by": f"carstage {episode.marker.versions.get('carstage')}",
        "episode_id": episode.id,
        **variant_entry(episode),
        "world": {
            "town": spec.map,
            "sync_mode": spec.timing.synchronous,
            "fixed_delta_seconds": spec.save_every / spec.fps,
        },
        "agents": {
            agent.folder: {
                "name": agent.name or "ego",
                "lidar": agent.lidar,
                "cameras": [camera.id for camera in agent.cameras],
            }
            for agent in agents
        },
    }


def _agent(view: Episode, folder: str, options: ExportOptions) -> CooperativeAgent:
    lidar = main_lidar(view, options)
    if lidar is None:
        whose = "the ego" if view.agent_name is None else f"agent {view.agent_name}"
        raise BadInputError(
            f"Episode {view.id}: {whose} has no LiDAR, which OPV2V is about.",
            "Add a sensor of kind lidar to its rig, or choose other episodes with --episode.",
        )
    cameras = _cameras(view, options)
    return CooperativeAgent(
        view.agent_name,
        folder,
        not view.spec.ego.is_vehicle,
        lidar.id,
        cameras[:MOST_CAMERAS],
    )


def _cameras(view: Episode, options: ExportOptions) -> tuple[SensorCalibration, ...]:
    """An agent's colour cameras that the options name, else all without a lens."""
    own = {s.id: s.calibration for s in view.sensors if s.content == COLOUR}
    named = [own[name] for name in dict.fromkeys(options.cameras) if name in own]
    for camera in named:
        if not camera.is_pinhole:
            raise no_place_for(camera)
    return tuple(named or (camera for camera in own.values() if camera.is_pinhole))
