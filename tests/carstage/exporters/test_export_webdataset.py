"""WebDataset exports, read by the webdataset package."""

from __future__ import annotations

import gc
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from analytic_dataset import attempt_of, recommit
from carstage.dataset import Dataset
from carstage.exporters import ClassMap, ExportOptions, export_dataset
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


@pytest.fixture(scope="module")
def large_ids(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The dataset with ids of actors above 255, and its first shard."""
    folder = Path(shutil.copytree(dataset, tmp_path_factory.mktemp("large") / "dataset"))
    for path in sorted(attempt_of(folder).glob("sensors/INST_FRONT/??????.png")):
        with Image.open(path) as picture:
            ids = np.asarray(picture).astype(np.uint16)
        Image.fromarray(ids + np.uint16(1000) * (ids > 0)).save(path)
    recommit(folder)
    out = tmp_path_factory.mktemp("export") / "out"
    export_dataset("webdataset", folder, out, workers=0)
    return folder, out / "train-000000.tar"


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


def test_a_class_map_names_and_numbers_what_it_keeps(dataset, wds, tmp_path: Path) -> None:
    numbered = {"car": {"name": "vehicle", "id": 4}, "walker_adult": {"name": "person", "id": 2}}
    options = ExportOptions(class_map=ClassMap.of(numbered))
    export_dataset("webdataset", dataset, tmp_path / "out", options, workers=0)
    shard = tmp_path / "out" / "train-000000.tar"
    episode = Dataset(dataset).episodes[0]
    rows = [r for r in episode.objects().to_pylist() if not r["is_ego"] and r["class"] in numbered]
    seen = episode.camera_objects().to_pylist()
    left_out = 0
    for k, sample in enumerate(wds.WebDataset(str(shard), shardshuffle=False).decode("rgb8")):
        labels = sample["labels.json"]
        wanted = {row["track_id"]: numbered[row["class"]] for row in rows if row["k"] == k}
        found = {
            r["track_id"]: {"name": r["class"], "id": r["class_id"]} for r in labels["objects"]
        }
        assert found == wanted
        assert {row["source_class"] for row in labels["objects"]} == set(numbered)
        for camera, boxes in labels["camera_objects"].items():
            own = [r["track_id"] for r in seen if (r["k"], r["sensor_id"]) == (k, camera)]
            assert [box["track_id"] for box in boxes] == [t for t in own if t in wanted]
            left_out += len(own) - len(boxes)
    assert left_out > 0


@pytest.mark.parametrize("pictures", ["rgb8", "l8", "pil", "rgb", None])
def test_ids_and_depths_are_whole_after_any_decoder(large_ids, wds, pictures: str | None) -> None:
    folder, shard = large_ids
    episode = Dataset(folder).episodes[0]
    samples = wds.WebDataset(str(shard), shardshuffle=False)
    decoded = list(samples.decode(pictures) if pictures else samples.decode())
    assert len(decoded) == 6
    for k, sample in enumerate(decoded):
        ids = sample["inst_front.npy"]
        np.testing.assert_array_equal(ids, episode.sensor("INST_FRONT").read(k))
        assert ids.dtype == np.uint16
        assert ids[..., 0].max() > 255
        np.testing.assert_array_equal(
            sample["depth_front.npy"], episode.sensor("DEPTH_FRONT").read(k)
        )
        assert not {name for name in sample if name.startswith(("inst_front.", "depth_front."))
                    and not name.endswith(".npy")}  # fmt: skip


def test_tags_are_whole_as_pictures_of_eight_bits(exported, dataset, wds) -> None:
    episode = Dataset(dataset).episodes[0]
    shard = exported("webdataset") / "train-000000.tar"
    for k, sample in enumerate(wds.WebDataset(str(shard), shardshuffle=False).decode("l8")):
        np.testing.assert_array_equal(sample["sem_front.png"], episode.sensor("SEM_FRONT").read(k))


def test_a_full_shard_is_followed_by_the_next(
    dataset, tmp_path, wds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exporter, "SHARD_BYTES", 100_000)
    out = tmp_path / "out"
    export_dataset("webdataset", dataset, out, workers=0)
    shards = json.loads((out / "shards.json").read_text())
    assert len(shards) > 1
    assert sum(shards.values()) == 6
    paths = [str(out / name) for name in shards]
    assert len(list(wds.WebDataset(paths, shardshuffle=False))) == 6


@pytest.mark.parametrize("class_map", [None, ClassMap.of({"car": "vehicle"})])
def test_what_a_camera_sees_is_among_the_objects(
    watched, wds, tmp_path: Path, class_map: ClassMap | None
) -> None:
    options = ExportOptions(class_map=class_map)
    export_dataset("webdataset", watched, tmp_path / "out", options, workers=0)
    ego = Dataset(watched).episodes[0].document["ego_id"]
    shard = tmp_path / "out/train-000000.tar"
    for sample in wds.WebDataset(str(shard), shardshuffle=False).decode("rgb8"):
        labels = sample["labels.json"]
        names = {row["track_id"]: row["class"] for row in labels["objects"]}
        assert names[ego] == ("vehicle" if class_map else "car")
        seen = {row["track_id"] for rows in labels["camera_objects"].values() for row in rows}
        assert ego in seen <= set(names)
