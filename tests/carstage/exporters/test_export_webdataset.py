"""WebDataset exports, read by the webdataset package."""

from __future__ import annotations

import gc
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from carstage.dataset import Dataset
from carstage.exporters.formats import webdataset as exporter

pytestmark = [
    pytest.mark.xdist_group("export"),
    # webdataset leaves the files that it has read to the garbage collector.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture
def wds() -> Iterator[Any]:
    """The package; its warnings come up in the tests that they are of."""
    yield pytest.importorskip("webdataset", reason="webdataset is not installed")
    gc.collect()


def test_samples_hold_pictures_points_and_labels(exported, dataset, wds) -> None:
    episode = Dataset(dataset).episodes[0]
    shard = exported("webdataset") / "train-000000.tar"
    samples = list(wds.WebDataset(str(shard), shardshuffle=False).decode("rgb8"))
    assert [sample["__key__"] for sample in samples] == [f"{episode.id}_{k:06d}" for k in range(6)]
    rows = episode.camera_objects().to_pylist()
    for k, sample in enumerate(samples):
        np.testing.assert_array_equal(sample["cam_front.png"], episode.sensor("CAM_FRONT").read(k))
        np.testing.assert_array_equal(sample["lidar_top.npy"], episode.sensor("LIDAR_TOP").read(k))
        labels = sample["labels.json"]
        assert labels["k"] == k
        own = [row for row in rows if row["k"] == k and row["sensor_id"] == "CAM_FRONT"]
        assert labels["camera_objects"]["CAM_FRONT"] == json.loads(json.dumps(own))
        world_from_camera = np.array(labels["world_from_ego"]) @ np.array(
            labels["sensors"]["CAM_FRONT"]["ego_from_sensor"]
        )
        np.testing.assert_allclose(
            world_from_camera, labels["sensors"]["CAM_FRONT"]["world_from_sensor"], atol=1e-4
        )


def test_a_full_shard_is_followed_by_the_next(
    dataset, tmp_path, wds, monkeypatch: pytest.MonkeyPatch
) -> None:
    from carstage.exporters import export_dataset

    monkeypatch.setattr(exporter, "SHARD_BYTES", 100_000)
    out = tmp_path / "out"
    export_dataset("webdataset", dataset, out, workers=0)
    shards = json.loads((out / "shards.json").read_text())
    assert len(shards) > 1
    assert sum(shards.values()) == 6
    paths = [str(out / name) for name in shards]
    assert len(list(wds.WebDataset(paths, shardshuffle=False))) == 6
