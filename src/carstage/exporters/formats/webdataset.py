"""WebDataset: tar files of samples, a sample per frame, for streaming training."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame, Row
from carstage.exporters.class_map import ClassMap
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.lenses import lens_entry
from carstage.exporters.options import ExportOptions
from carstage.exporters.splits import Split
from carstage.exporters.variants import variant_entry
from carstage.sensor_kinds.model import COLOUR, NORMALS, TAGS

SHARD_BYTES = 1 << 29
"""A new tar file is begun when one is at least that large: some hundred frames each."""

_PICTURES = (COLOUR, NORMALS, TAGS)
"""Contents whose files are pictures of eight bits. webdataset's decoders know no others: of 16 bits
they keep eight, and a depth in three channels becomes a shade."""

Sample = tuple[tuple[str, bytes], ...]


@dataclass(frozen=True, slots=True)
class SampleWriter:
    """Collects the files of a frame; returns their names and contents."""

    options: ExportOptions

    def __call__(self, frame: Frame, folder: Path) -> Sample:
        """The sample: pictures of eight bits as they are, the rest ``.npy``, labels ``.json``.

        Names have one key, up to the first dot: the episode's id and the frame.
        """
        del folder
        key = f"{frame.episode.id}_{frame.k:06d}"
        files: list[tuple[str, bytes]] = []
        for sensor in frame.episode.sensors:
            if not frame.has(sensor.id):
                continue
            name = f"{key}.{sensor.id.lower()}"
            if sensor.content in _PICTURES:
                files += [
                    (name + "".join(path.name.partition(".")[1:]), path.read_bytes())
                    for path in sensor.paths(frame.k)
                ]
            else:
                stream = io.BytesIO()
                np.save(stream, sensor.read(frame.k), allow_pickle=False)
                files.append((f"{name}.npy", stream.getvalue()))
        files.append(
            (f"{key}.labels.json", json.dumps(_labels(frame, self.options.class_map)).encode())
        )
        return tuple(files)


def _labels(frame: Frame, class_map: ClassMap | None) -> Mapping[str, Any]:
    """All label rows of the frame, and what is needed to use them without the dataset.

    With a class map those that have a target, under its name and number.
    """
    objects, seen = _objects(frame), frame.camera_objects
    if class_map is not None:
        objects = _mapped(objects, class_map)
        seen = {
            camera: [row for row in rows if row["track_id"] in objects]
            for camera, rows in seen.items()
        }
    sensors = frame.episode.calibration.sensors
    return {
        "episode_id": frame.episode.id,
        **variant_entry(frame.episode),
        "k": frame.k,
        "timestamp_s": frame.timestamp_s,
        "ego": frame.ego,
        "world_from_ego": frame.world_from_ego.tolist(),
        "sensors": {
            name: {
                "kind": sensor.kind,
                "ego_from_sensor": frame.ego_from_sensor(name).tolist(),
                "world_from_sensor": frame.world_from_sensor(name).tolist(),
                "K": sensor.k.tolist() if sensor.is_projective else None,
                **lens_entry(sensor),
            }
            for name, sensor in sensors.items()
        },
        "objects": list(objects.values()),
        "camera_objects": {camera: list(rows) for camera, rows in seen.items()},
        "unlabelled_cameras": sorted(
            {
                *frame.unlabelled,
                # Nothing is projected into pictures with CARLA's own lens distortion.
                *(name for name, one in sensors.items() if one.labelled and not one.is_projective),
            }
        ),
    }


def _objects(frame: Frame) -> Mapping[int, Row]:
    """The objects by track id, among them the ego where a camera shows it."""
    ego = frame.ego_object
    shown = {row["track_id"] for rows in frame.camera_objects.values() for row in rows}
    if ego is None or ego["track_id"] not in shown:
        return frame.objects
    return {**frame.objects, ego["track_id"]: ego}


def _mapped(objects: Mapping[int, Row], class_map: ClassMap) -> dict[int, Row]:
    """The objects that have a target, by track id; ``source_class`` is Car-STAGE's class."""
    numbers = class_map.numbers(0)
    found: dict[int, Row] = {}
    for track_id, row in objects.items():
        target = class_map.target(row["class"], row["blueprint"])
        if target is not None:
            found[track_id] = {
                **row,
                "class": target.name,
                "class_id": numbers[target.name],
                "source_class": row["class"],
            }
    return found


@register
class WebDataset(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "webdataset"
    summary: ClassVar = "WebDataset: tar shards with a sample per frame, all sensors and labels."
    uses: ClassVar = frozenset({"class_map", "val_share", "test_share"})

    def __init__(self, options: ExportOptions) -> None:
        super().__init__(options)
        self._tars: dict[Split, tarfile.TarFile] = {}
        self._samples: dict[Split, list[int]] = {}

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Every rig will do."""
        del episodes
        self._folder = folder

    def begin_episode(self, episode: Episode) -> SampleWriter:
        """All frames of an episode go to one split."""
        self._split = self.split_of(episode)
        return SampleWriter(self.options)

    def add(self, part: Sample) -> None:
        """Append the sample, to a new tar file if the last one is full."""
        split = self._split
        tar = self._tars.get(split)
        if tar is None or tar.offset >= SHARD_BYTES:
            if tar is not None:
                tar.close()
            counts = self._samples.setdefault(split, [])
            path = self._folder / f"{split}-{len(counts):06d}.tar"
            tar = tarfile.open(path, "w", format=tarfile.USTAR_FORMAT)  # noqa: SIM115 - see files
            self._tars[split] = self.files.enter_context(tar)
            counts.append(0)
        for name, content in part:
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            entry.mode = 0o644
            tar.addfile(entry, io.BytesIO(content))
        self._samples[split][-1] += 1

    def end_episode(self) -> None:
        """Nothing is kept per episode."""

    def finish(self) -> None:
        """Close the tar files and write ``shards.json``: samples by tar file."""
        self.close()
        shards = {
            f"{split}-{number:06d}.tar": samples
            for split, counts in sorted(self._samples.items())
            for number, samples in enumerate(counts)
        }
        (self._folder / "shards.json").write_text(json.dumps(shards, indent=1) + "\n")
