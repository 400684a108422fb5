"""What every ``Exporter`` must do; subclass ``ExporterTests``, give it a format and a dataset."""

# ruff: noqa: D102 (the name of a test states its rule)

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import pytest

from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import (
    ClassMap,
    ExportOptions,
    Frame,
    export_dataset,
    exporter_for,
    exporters,
)

_NOT_DEFAULT: dict[str, Any] = {
    "cameras": ("CAM",),
    "lidar": "LIDAR",
    "boxes": "modal",
    "occlusion": "pixel",
    "min_lidar_points": 1,
    "max_distance_m": 1.0,
    "include_invisible": True,
    "val_share": 0.5,
    "test_share": 0.2,
    "classes": ("car",),
    "messages": "ros2",
    "categories": "coco80",
    "class_map": ClassMap.of({"car": "Car"}),
    "keyframes_hz": 1.0,
    "nuscenes_locations": True,
    "agent": "car2",
}


class ExporterTests:
    """The contract of an exporter, as tests; a fixture ``dataset`` gives the folder of a dataset.

    Attributes:
        name: name of the format.
    """

    name: str

    def test_equal_datasets_give_equal_bytes(self, dataset: Path, tmp_path: Path) -> None:
        for out in ("a", "b"):
            export_dataset(self.name, dataset, tmp_path / out, workers=0)
        first, second = _hashes(tmp_path / "a"), _hashes(tmp_path / "b")
        assert first == second
        assert len(first) > 1

    def test_a_failure_leaves_nothing_and_closes_its_files(
        self, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(*_: Any) -> None:
            raise OSError("no space")

        monkeypatch.setattr(exporters()[self.name], "finish", fail)
        with pytest.raises(OSError, match="no space"):
            export_dataset(self.name, dataset, tmp_path / "out", workers=0)
        assert not list(tmp_path.iterdir())

    def test_frames_without_any_data_are_no_failure(self, dataset: Path, tmp_path: Path) -> None:
        exporter = exporter_for(self.name, ExportOptions())
        episodes = Dataset(dataset).episodes
        exporter.begin(episodes, tmp_path)
        writer = exporter.begin_episode(episodes[0])
        for k in range(episodes[0].frames):
            part = writer(_without_data(episodes, k), tmp_path)
            if part is not None:
                exporter.add(part)
        exporter.end_episode()
        exporter.finish()
        exporter.close()

    def test_it_refuses_the_options_that_it_does_not_use(self) -> None:
        uses = exporters()[self.name].uses
        whole_fleet = exporters()[self.name].with_agents
        assert uses <= set(_NOT_DEFAULT)
        for option, value in _NOT_DEFAULT.items():
            options = ExportOptions(**{option: value})
            if option in uses or (option == "agent" and not whole_fleet):
                exporter_for(self.name, options)
            else:
                with pytest.raises(BadInputError, match="does not use"):
                    exporter_for(self.name, options)


def _without_data(episodes: tuple[Any, ...], k: int) -> Frame:
    """A frame that no sensor has data of."""
    from carstage.exporters import EpisodeFrames

    episode = episodes[0]
    damage = frozenset((sensor.id, k) for sensor in episode.sensors)
    return EpisodeFrames(episode, damage).frame(k)


def _hashes(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
