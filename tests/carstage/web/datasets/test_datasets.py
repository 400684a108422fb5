"""Datasets over the wire: lists, frames, pictures, points, tables, counts."""

import io
import json
import shutil
import zipfile
from pathlib import Path

import carla
import numpy as np
import pytest
from PIL import Image

from analytic_dataset import attempt_of, recommit
from carstage.dataset import Dataset
from carstage.report.statistics import LIDAR_EDGES, LabelStatistics
from carstage.storage.local import LocalStore
from carstage.storage.maps import map_name
from carstage.web.datasets.history import _signals
from carstage.web.roots import Roots
from sites import Site, open_site
from small_episodes import add_episode

pytestmark = pytest.mark.xdist_group("web")  # one site for all


def test_datasets_are_listed_with_sizes_and_states(site: Site) -> None:
    listed = {d["dataset"]: d for d in site.client.get("/api/datasets").json()["datasets"]}
    episode = Dataset(site.root / "town").episodes[0]
    entry = listed["town"]
    assert (entry["state"], entry["episodes"], entry["frames"]) == ("ready", 1, episode.frames)
    assert entry["bytes"] == sum(file.bytes for file in episode.marker.files)
    assert entry["name"] == "analytic <scene>"


def test_damaged_datasets_say_so_and_hide_nothing_else(site: Site) -> None:
    broken = site.root / "broken"
    (broken / "commits").mkdir(parents=True)
    (broken / "dataset.json").write_text("{")
    site.client.get("/api/datasets")
    listed = {}
    for _ in range(30):
        listed = {d["dataset"]: d for d in site.client.get("/api/datasets").json()["datasets"]}
        if "broken" in listed:
            break
    assert listed["town"]["state"] == "ready"
    if "broken" in listed:  # the list is looked for once a second
        assert listed["broken"]["state"] == "damaged"
        assert str(site.root) not in listed["broken"]["problem"]
    assert site.client.get("/api/datasets/broken").status_code == 409


def test_frames_carry_what_the_dataset_holds(site: Site) -> None:
    episode = Dataset(site.root / "town").episodes[0]
    frame = list(episode.iter_frames())[1]
    told = site.client.get(f"{site.episode_url}/frames/1").json()
    assert told["timestamp_s"] == frame.timestamp_s
    assert {o["track_id"] for o in told["objects"]} == set(frame.objects)
    for row in told["objects"]:
        known = frame.objects[row["track_id"]]
        np.testing.assert_allclose(np.array(row["ego_from_box"])[:3, 3], known["box_center_ego"])
    for camera, rows in told["camera_objects"].items():
        assert len(rows) == len(frame.camera_objects[camera])
        for row in rows:
            assert row["has_mask"] == (row["track_id"] in masked(frame, camera))
            assert "mask_modal" not in row["row"]


def masked(frame: object, camera: str) -> set[int]:
    rows = frame.camera_objects[camera]  # type: ignore[attr-defined]
    return {row["track_id"] for row in rows if row["mask_modal"] is not None}


def test_edges_of_boxes_surround_the_amodal_box(site: Site) -> None:
    told = site.client.get(f"{site.episode_url}/frames/0").json()
    seen = 0
    for rows in told["camera_objects"].values():
        for row in rows:
            if row["bbox_amodal"] is None or not row["lines"] or row["truncated"]:
                continue
            ends = np.array(row["lines"]).reshape(-1, 2)
            bounds = [*ends.min(axis=0), *ends.max(axis=0)]
            np.testing.assert_allclose(bounds, row["bbox_amodal"], atol=1.0)
            seen += 1
    assert seen


def test_pictures_are_the_datasets_own_and_others_are_coloured(site: Site) -> None:
    episode = Dataset(site.root / "town").episodes[0]
    for sensor in episode.sensors:
        url = f"{site.episode_url}/sensors/{sensor.id}/0.png"
        answer = site.client.get(url)
        if not sensor.calibration.is_camera:
            assert answer.status_code == 404
            continue
        picture = Image.open(io.BytesIO(answer.content))
        assert picture.size == (sensor.calibration.width, sensor.calibration.height)
        if sensor.kind == "rgb":
            assert answer.content == sensor.paths(0)[0].read_bytes()
        small = Image.open(io.BytesIO(site.client.get(url, params={"width": 64}).content))
        assert small.width == 64


def test_masks_cover_the_pixels_of_visible_objects(site: Site) -> None:
    frame = next(iter(Dataset(site.root / "town").episodes[0].iter_frames()))
    camera, rows = next(iter(frame.camera_objects.items()))
    answer = site.client.get(f"{site.episode_url}/masks/{camera}/0.png")
    alpha = np.asarray(Image.open(io.BytesIO(answer.content)))[..., 3]
    expected = sum(row["visible_px"] for row in rows if row["visible"] and row["mask_modal"])
    assert np.count_nonzero(alpha) == expected


def test_points_are_in_the_egos_axes(site: Site) -> None:
    episode = Dataset(site.root / "town").episodes[0]
    lidar = next(sensor for sensor in episode.sensors if sensor.kind == "lidar")
    answer = site.client.get(f"{site.episode_url}/points/{lidar.id}/0")
    points = np.frombuffer(answer.content, "<f4").reshape(-1, 4)
    own = lidar.read(0)
    pose = lidar.calibration.ego_from_sensor
    expected = own[:, :3].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(points[:, :3], expected, atol=1e-4)
    np.testing.assert_array_equal(points[:, 3], own[:, 3])


def test_the_egos_signals_are_those_of_its_table(site: Site) -> None:
    rows = Dataset(site.root / "town").episodes[0].ego().to_pylist()
    told = site.client.get(f"{site.episode_url}/ego").json()
    assert told["speed_m_s"] == [row["speed"] for row in rows]
    assert told["steer"] == [row["steer"] for row in rows]
    forward = [row["acceleration_ego"] and row["acceleration_ego"][0] for row in rows]
    assert told["acceleration_m_s2"] == forward
    assert len(rows) == len(site.client.get(site.episode_url).json()["times_s"])


def test_episodes_tell_rig_times_and_way(site: Site) -> None:
    episode = site.client.get(site.episode_url).json()
    assert len(episode["times_s"]) == episode["episode"]["frames"]
    assert {s["data"] for s in episode["sensors"]} >= {"image", "points"}
    town = site.client.get(f"{site.episode_url}/map").json()
    assert town["lanes"] == []  # no map of the simulator
    assert len(town["track"]) == episode["episode"]["frames"]


@pytest.mark.parametrize("k", [10_000, -1, "x"])
def test_frames_that_are_not_there_are_not_found(site: Site, k: object) -> None:
    assert site.client.get(f"{site.episode_url}/frames/{k}").status_code in (404, 422)


def test_tables_are_filtered_sorted_and_cut(site: Site) -> None:
    url = f"/api/datasets/{site.dataset}/table"
    everything = site.client.post(url, json={"table": "camera_objects", "limit": 1000}).json()
    names = [column["name"] for column in everything["columns"]]
    assert {"class", "blueprint", "episode_id"} < set(names)
    request = {
        "table": "camera_objects",
        "filters": [
            {"column": "class", "op": "eq", "value": "car"},
            {"column": "visible", "op": "eq", "value": True},
            {"column": "distance", "op": "lt", "value": 40},
            {"column": "blueprint", "op": "contains", "value": "AUDI"},
        ],
        "sort": "distance",
        "descending": True,
        "limit": 3,
    }
    page = site.client.post(url, json=request).json()
    rows = [dict(zip(names, row, strict=True)) for row in everything["rows"]]
    fitting = [r["distance"] for r in rows
               if r["class"] == "car" and r["visible"] and r["distance"] < 40
               and "audi" in r["blueprint"]]  # fmt: skip
    assert page["total"] == len(fitting) > 0
    shown = [row[names.index("distance")] for row in page["rows"]]
    assert shown == sorted(fitting, reverse=True)[:3]


def test_conditions_are_read_as_the_type_of_their_column(site: Site) -> None:
    url = f"/api/datasets/{site.dataset}/table"

    def total(column: str, op: str, value: object) -> int:
        request = {"filters": [{"column": column, "op": op, "value": value}]}
        found: int = site.client.post(url, json=request).json()["total"]
        return found

    assert 0 < total("visible", "eq", "yes") == total("visible", "eq", True)
    assert total("visible", "eq", " False") == total("visible", "eq", "no")
    assert total("visible", "eq", "no") == total("visible", "eq", False)
    assert 0 < total("distance", "lt", "20.") == total("distance", "lt", 20)
    assert 0 < total("k", "eq", "1") == total("k", "eq", 1)


def test_a_dataset_without_events_has_an_empty_table_of_them(site: Site) -> None:
    url = f"/api/datasets/{site.dataset}/table"
    page = site.client.post(url, json={"table": "events"}).json()
    assert page["rows"] == []
    columns = {column["name"]: column for column in page["columns"]}
    assert columns["min_distance"]["unit"] == "m"
    assert "k" in columns


@pytest.mark.parametrize("table", ["objects", "ego", "frames"])
def test_every_table_has_pages(site: Site, table: str) -> None:
    page = site.client.post(f"/api/datasets/{site.dataset}/table", json={"table": table}).json()
    assert page["rows"]
    assert page["columns"]


@pytest.mark.parametrize(
    "request_",
    [
        {"filters": [{"column": "nothing", "op": "eq", "value": 1}]},
        {"filters": [{"column": "distance", "op": "eq", "value": "near"}]},
        {"filters": [{"column": "visible", "op": "eq", "value": "none"}]},
        {"filters": [{"column": "corners_uv", "op": "lt", "value": 1}]},
        {"sort": "nothing"},
        {"sort": "corners_uv"},
        {"limit": 0},
        {"table": "secrets"},
    ],
)
def test_conditions_that_make_no_sense_are_refused(site: Site, request_: dict[str, object]) -> None:
    answer = site.client.post(f"/api/datasets/{site.dataset}/table", json=request_)
    assert answer.status_code == 422


def test_statistics_count_the_labels(site: Site) -> None:
    episode = Dataset(site.root / "town").episodes[0]
    told = site.client.get(f"/api/datasets/{site.dataset}/statistics").json()
    assert told["visible"] == episode.camera_objects()["visible"].to_pylist().count(True)
    assert sum(told["frames_by_map"].values()) == episode.frames
    for histogram in told["histograms"]:
        assert len(histogram["bins"]) == len(histogram["counts"])


def test_statistics_tell_lidar_points_only_where_a_lidar_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_episode(tmp_path / "few", "0123456789abcdef")
    titles = []
    for counts in ([0] * len(LIDAR_EDGES), [1] * len(LIDAR_EDGES)):
        counted = LabelStatistics(lidar_points=counts)
        monkeypatch.setattr("carstage.report.statistics.count_labels", lambda _, c=counted: c)
        with open_site(tmp_path) as client:
            told = client.get("/api/datasets/few/statistics").json()
        titles.append({histogram["title"] for histogram in told["histograms"]})
    assert titles[1] - titles[0] == {"LiDAR points per object"}


def test_sweeps_are_put_together_where_the_ego_is_now(site: Site) -> None:
    episode = Dataset(site.root / "town").episodes[0]
    lidar = next(sensor for sensor in episode.sensors if sensor.kind == "lidar")
    url = f"{site.episode_url}/points/{lidar.id}/2"
    one, three = (
        np.frombuffer(site.client.get(url, params={"sweeps": n}).content, "<f4").reshape(-1, 4)
        for n in (1, 3)
    )
    np.testing.assert_array_equal(three[: len(one)], one)
    assert len(three) == sum(len(lidar.read(k)) for k in range(3))
    # The ground stays the ground, and what stands still stands where it stood.
    world = [frame.world_from_sensor(lidar.id) for frame in list(episode.iter_frames())[:3]]
    ego_from_world = np.array(lidar.calibration.ego_from_sensor) @ np.linalg.inv(world[2])
    first = lidar.read(0)[:, :3].astype(np.float64)
    place = ego_from_world @ world[0]
    expected = first @ place[:3, :3].T + place[:3, 3]
    np.testing.assert_allclose(three[len(one) : len(one) + len(first), :3], expected, atol=1e-3)
    assert site.client.get(url, params={"sweeps": 21}).status_code == 422


def test_the_history_is_that_of_the_tables(site: Site) -> None:
    episode = Dataset(site.root / "town").episodes[0]
    told = site.client.get(f"{site.episode_url}/history", params={"near_m": 9.0}).json()
    rows = [row for row in episode.objects().to_pylist() if not row["is_ego"]]
    for track in told["tracks"]:
        own = [row for row in rows if row["track_id"] == track["track_id"]]
        frames = [k for first, last in track["spans"] for k in range(first, last + 1)]
        assert frames == [row["k"] for row in own]
        assert track["nearest_m"] == min(row["distance_ego"] for row in own)
    assert len(told["tracks"]) == len({row["track_id"] for row in rows})
    walkers = [row for row in rows if row["class"].startswith("walker")]
    near = next(row["k"] for row in walkers if row["distance_ego"] < 9.0)
    jumps = [m["k"] for m in told["moments"] if m["kind"] == "Pedestrian under 9 m"]
    assert jumps == [near]
    seen = [row for row in episode.camera_objects().to_pylist() if row["visible"]]
    most = max(row["occlusion_ratio"] or 0.0 for row in seen)
    hidden = next(m for m in told["moments"] if m["kind"] == "Most occluded")
    assert f"{most:.0%} hidden" in hidden["text"]


def test_rows_are_counted_by_class_beside_a_choice_of_class(site: Site) -> None:
    url = f"/api/datasets/{site.dataset}/table"
    every = site.client.post(url, json={"table": "objects"}).json()
    assert sum(every["classes"].values()) == every["total"]
    chosen = {"column": "class", "op": "eq", "value": "truck"}
    trucks = site.client.post(url, json={"table": "objects", "filters": [chosen]}).json()
    assert trucks["total"] == every["classes"]["truck"]
    assert trucks["classes"] == every["classes"]


def test_a_dataset_is_sent_with_the_maps_of_its_towns(site: Site, tmp_path: Path) -> None:
    town = Path(shutil.copytree(site.root / "town", tmp_path / "datasets" / "town"))
    store = LocalStore(town)
    named = {"opendrive": store.keep_map(b"a text"), "vector_map": store.keep_map(b"M", "parquet")}
    path = attempt_of(town) / "episode.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | named))
    recommit(town)
    with open_site(town.parent) as client:
        sent = zipfile.ZipFile(io.BytesIO(client.get("/api/datasets/town/files.zip").content))
    for kind, name in zip(("xodr", "parquet"), named.values(), strict=True):
        assert f"town/{map_name(name, kind)}" in sent.namelist()


def test_a_root_of_many_folders_hides_no_other_root(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("carstage.web.roots._MOST_FOLDERS", 5)
    for number in range(10):
        (tmp_path / "many" / f"folder{number}").mkdir(parents=True)
    (tmp_path / "other" / "drives" / "commits").mkdir(parents=True)
    roots = Roots([tmp_path / "many", tmp_path / "other"])
    assert list(roots.datasets()) == ["drives~r1"]


def test_datasets_in_a_root_that_is_one_itself_are_listed(tmp_path: Path) -> None:
    for folder in ("commits", "episodes/e/a1/commits", "exports/mine/commits"):
        (tmp_path / "drives" / folder).mkdir(parents=True)
    roots = Roots([tmp_path / "drives"])
    assert list(roots.datasets()) == ["drives"]
    recorded = roots.new("town")
    assert isinstance(recorded, Path)
    (recorded / "commits").mkdir(parents=True)
    (recorded / "inner/commits").mkdir(parents=True)
    roots.forget()
    assert list(roots.datasets()) == ["drives", roots.id_of(recorded)]


def test_lights_of_vehicles_are_named_as_carla_has_them() -> None:
    bits = carla.VehicleLightState
    named = {
        bits.Position: None,
        bits.LowBeam: None,
        bits.HighBeam: None,
        bits.Brake: "brake",
        bits.RightBlinker: "right blinker",
        bits.LeftBlinker: "left blinker",
        bits.Reverse: "reverse",
        bits.Fog: None,
        bits.Interior: None,
        bits.Special1: "special 1",
        bits.Special2: "special 2",
    }
    assert {bit: _signals(int(bit)) for bit in named} == named
