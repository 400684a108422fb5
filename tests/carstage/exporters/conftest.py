"""One small dataset of the analytic scene, and its exports, for all tests of exporters."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from analytic_dataset import SIZE, make_dataset, make_watched
from carstage.exporters import ExportOptions, export_dataset
from devkits import nuscenes_devkit

Export = Callable[..., Path]


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six frames: two labelled cameras, a car, a fire engine, a pedestrian. Do not change it."""
    return make_dataset(
        tmp_path_factory.mktemp("dataset") / "out", tmp_path_factory.mktemp("raw"), size=SIZE
    )


@pytest.fixture(scope="session")
def segmented(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """13 frames with a semantic LiDAR beside the LiDAR, and sensors on another car."""
    return make_dataset(
        tmp_path_factory.mktemp("segmented") / "out",
        tmp_path_factory.mktemp("raw"),
        size=SIZE,
        steps=13,
        segmentation=True,
    )


@pytest.fixture(scope="session")
def every_kind(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same drive with all kinds of sensors. Do not change it."""
    return make_dataset(
        tmp_path_factory.mktemp("every_kind") / "out",
        tmp_path_factory.mktemp("raw"),
        size=SIZE,
        every_kind=True,
    )


@pytest.fixture(scope="session")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two frames of the drive with the ego in the pictures of CAM_FRONT. Do not change it."""
    folder = tmp_path_factory.mktemp("watched")
    return make_watched(folder / "out", folder)


@pytest.fixture(scope="session")
def devkit() -> SimpleNamespace:
    """nuscenes-devkit."""
    return nuscenes_devkit()


@pytest.fixture(scope="session")
def exported(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Export:
    """Exports the dataset, once per format and choice of options."""
    made: dict[tuple[str, ExportOptions], Path] = {}

    def export(format_name: str, **choices: object) -> Path:
        options = ExportOptions(**choices)  # type: ignore[arg-type]
        if (format_name, options) not in made:
            out = tmp_path_factory.mktemp("export") / "out"
            export_dataset(format_name, dataset, out, options, workers=0)
            made[format_name, options] = out
        return made[format_name, options]

    return export
