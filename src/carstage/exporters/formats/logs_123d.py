"""123D: Arrow logs that py123d reads, a log per episode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.files_123d import DATASET, FORMAT, LogFiles, log_metadata
from carstage.exporters.formats.map_123d import map_metadata, write_map
from carstage.exporters.formats.modalities_123d import frame_rows, microseconds, rig_of
from carstage.exporters.options import ExportOptions


@dataclass(frozen=True, slots=True)
class FramePart:
    """What a frame adds to the files of its log.

    Attributes:
        time_us: time since the first frame.
        rows: by key of a modality.
        left_out: ids of the sensors that 123D has no place for.
    """

    time_us: int
    rows: Mapping[str, Mapping[str, Any]]
    left_out: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RowWriter:
    """Makes the rows of a frame.

    Attributes:
        keys: by id of a sensor, the key of its modality.
        options: the choices.
    """

    keys: Mapping[str, str]
    options: ExportOptions

    def __call__(self, frame: Frame, folder: Path) -> FramePart:
        """The rows of all modalities."""
        del folder
        left_out = tuple(
            sensor.id
            for sensor in frame.episode.sensors
            if sensor.id not in self.keys and frame.has(sensor.id)
        )
        rows = frame_rows(frame, self.keys, self.options)
        return FramePart(microseconds(frame.timestamp_s), rows, left_out)


@register
class Logs123d(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "123d"
    summary: ClassVar = "123D: Arrow logs that py123d reads, a log per episode."
    with_maps: ClassVar = True
    uses: ClassVar = frozenset(
        {"cameras", "classes", "max_distance_m", "min_lidar_points", "test_share", "val_share"}
    )

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Look at the rigs; every rig will do."""
        for episode in episodes:
            rig_of(episode, self.options)
        self._folder = folder
        self._towns: dict[str, str] = {}

    def begin_episode(self, episode: Episode) -> RowWriter:
        """Make the log's folder."""
        rig = rig_of(episode, self.options)
        split = f"{DATASET}_{self.split_of(episode)}"
        place = self._folder / "logs" / split / episode.id
        place.mkdir(parents=True)
        town = str(episode.document["map"]).rpartition("/")[2]
        about = self._write_map(episode, town, place, split)
        self._log = LogFiles(place, log_metadata(split, episode.id, town, about), rig.modalities)
        self.files.callback(self._log.close)
        return RowWriter(rig.keys, self.options)

    def _write_map(
        self, episode: Episode, town: str, place: Path, split: str
    ) -> dict[str, Any] | None:
        """Write the episode's map; what is said of it, None where there is none.

        A town's first map is that of all logs there. A log of another map by the same name has it
        in its own folder, where py123d looks first.
        """
        file = episode.vector_map_file
        if file is None or episode.id in self.lost_maps:
            return None
        about = map_metadata(DATASET, town, FORMAT)
        path = self._folder / "maps" / DATASET / f"{DATASET}_{town}.arrow"
        if self._towns.setdefault(town, file.name) != file.name:
            path = place / "map.arrow"
            about |= {"split": split, "log_name": episode.id, "map_is_per_log": True}
        if not path.exists() and (found := episode.vector_map()) is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_map(found, path, about)
        return about

    def add(self, part: FramePart) -> None:
        """Append the frame's rows."""
        self.sensors_left_out.update(part.left_out)
        self._log.add(part.time_us, part.rows)

    def end_episode(self) -> None:
        """Write the file that joins the others."""
        self._log.finish()
        self.close()

    def finish(self) -> None:
        """Every log is whole already."""
