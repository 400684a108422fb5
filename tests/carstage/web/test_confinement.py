"""No request reaches a file outside the roots, and none is too large."""

import sys
from pathlib import Path
from typing import Any

import pytest

import analytic_dataset
from carstage.errors import BadInputError
from carstage.web.errors import WebError
from carstage.web.limits import MOST_BYTES
from carstage.web.roots import Roots
from sites import Site, open_site

pytestmark = pytest.mark.xdist_group("web")  # one site for all

TRAVERSALS = [
    "../secret",
    "..%2fsecret",
    "%2e%2e%2fsecret",
    "..~secret",
    "town~..~..~secret",
    "/etc",
    "%2fetc%2fpasswd",
    "town%00",
    ".carstage-gui",
]


@pytest.mark.parametrize("name", TRAVERSALS)
@pytest.mark.parametrize(
    "path",
    [
        "/api/datasets/{}",
        "/api/datasets/{}/statistics",
        "/api/datasets/town/episodes/{}",
        "/api/datasets/town/episodes/{}/frames/0",
        "/api/runs/{}",
        "/api/vehicles/{}",
        "/api/presets/rig/{}",
        "/assets/{}",
    ],
)
def test_traversals_find_nothing(site: Site, path: str, name: str) -> None:
    answer = site.client.get(path.format(name))
    assert answer.status_code in (404, 422)
    assert str(site.root) not in answer.text


@pytest.mark.parametrize("name", TRAVERSALS)
@pytest.mark.parametrize("kind", ["sensors/{}/0.png", "masks/{}/0.png", "points/{}/0"])
def test_sensors_are_those_of_the_calibration(site: Site, kind: str, name: str) -> None:
    answer = site.client.get(f"{site.episode_url}/{kind.format(name)}")
    assert answer.status_code in (404, 422)


@pytest.mark.parametrize("name", ["..", "../x", "a/b", "/tmp/x", ".hidden", "", "a\0b", "-rf"])
def test_runs_and_exports_write_to_plain_names_alone(
    site: Site, demo: dict[str, Any], name: str
) -> None:
    run = site.client.post("/api/runs", json={"dataset": name, "config": demo})
    export = site.client.post(
        f"/api/datasets/{site.dataset}/export", json={"format": "coco", "out": name}
    )
    assert (run.status_code, export.status_code) == (422, 422)


def test_recordings_outside_the_roots_are_not_replayed(site: Site, demo: dict[str, Any]) -> None:
    for episode in ("/etc", "../other/episodes/x/a1", "~/other/episodes/x/a1"):
        config = {**demo, "scenario": {"kind": "replay", "episode": episode}}
        check = site.client.post("/api/config/check", json={"config": config}).json()
        assert [error["path"] for error in check["errors"]] == [["scenario", "episode"]]
        assert "outside" in check["errors"][0]["message"]


@pytest.mark.parametrize("kind", ["log", "openscenario"])
@pytest.mark.parametrize("file", ["/etc/hostname", "../drive.log", "~/drive.log"])
def test_files_of_scenarios_outside_the_roots_are_not_read(
    site: Site, demo: dict[str, Any], kind: str, file: str
) -> None:
    config = {**demo, "scenario": {"kind": kind, "file": file}}
    check = site.client.post("/api/config/check", json={"config": config}).json()
    assert [error["path"] for error in check["errors"]] == [["scenario", "file"]]
    assert "outside" in check["errors"][0]["message"]


@pytest.mark.parametrize(
    ("section", "path"),
    [
        ({"map": "/etc/My.xodr"}, ["map", "choice"]),
        ({"server": {"kind": "embedded", "maps": ["../towns"]}}, ["server", "maps", 0]),
        (
            {"patches": [{"target": "billboard", "file": "../../secret.png"}]},
            ["patches", 0, "file"],
        ),
    ],
)
def test_maps_outside_the_roots_are_not_looked_at(
    site: Site, demo: dict[str, Any], section: dict[str, Any], path: list[str | int]
) -> None:
    check = site.client.post("/api/config/check", json={"config": {**demo, **section}}).json()
    assert [error["path"] for error in check["errors"]] == [path]
    assert "outside" in check["errors"][0]["message"]


def test_programs_that_a_request_names_are_not_run(site: Site, demo: dict[str, Any]) -> None:
    for python in ("/bin/sh", "./python", sys.executable + "x"):
        config = {**demo, "server": {"kind": "embedded", "client_python": python}}
        check = site.client.post("/api/config/check", json={"config": config}).json()
        assert [error["path"] for error in check["errors"]] == [["server", "client_python"]]
    run = site.client.post("/api/runs", json={"dataset": "x", "config": config})
    assert run.status_code == 422  # refused by the same check, which takes seconds
    own = {**demo, "server": {"kind": "embedded", "client_python": sys.executable}}
    assert site.client.post("/api/config/check", json={"config": own}).json()["ok"]


def test_classes_that_a_request_names_do_not_drive(site: Site, demo: dict[str, Any]) -> None:
    config = {**demo, "ego": {"driver": "os:_exit"}}
    check = site.client.post("/api/config/check", json={"config": config}).json()
    assert [error["path"] for error in check["errors"]] == [["ego", "driver", "name"]]
    answer = site.client.post("/api/runs", json={"config": config, "dataset": "new"})
    assert answer.status_code == 422


def test_classes_that_a_request_names_start_no_server(site: Site, demo: dict[str, Any]) -> None:
    server = {"kind": "class", "name": "os:_exit"}
    config = {**demo, "server": server}
    check = site.client.post("/api/config/check", json={"config": config}).json()
    assert [error["path"] for error in check["errors"]] == [["server", "name"]]
    answer = site.client.post("/api/runs", json={"config": config, "dataset": "new"})
    assert answer.status_code == 422
    tested = site.client.post("/api/server/check", json={"server": server}).json()
    assert not tested["ok"]
    assert "runs its code" in tested["message"]


@pytest.mark.parametrize(
    "scenario",
    [
        {"kind": "scenic", "file": "a.scenic", "python": "/bin/sh"},
        {"kind": "openscenario", "file": "a.xosc", "scenario_runner": "runner"},
    ],
)
def test_programs_of_scenarios_are_not_started(
    site: Site, demo: dict[str, Any], scenario: dict[str, str]
) -> None:
    config = {**demo, "scenario": scenario}
    check = site.client.post("/api/config/check", json={"config": config}).json()
    assert [error["path"] for error in check["errors"]] == [["scenario", "file"]]
    answer = site.client.post("/api/runs", json={"config": config, "dataset": "new"})
    assert answer.status_code == 422


def test_drives_outside_the_roots_are_not_driven_again(site: Site, demo: dict[str, Any]) -> None:
    config = {**demo, "ego": {"driver": {"kind": "replay", "episode": "/etc"}}}
    check = site.client.post("/api/config/check", json={"config": config}).json()
    assert [error["path"] for error in check["errors"]] == [["ego", "driver", "episode"]]


def test_files_of_an_episode_that_are_links_out_of_the_roots_are_not_served(
    tmp_path: Path,
) -> None:
    secret = tmp_path / "secret.png"
    secret.write_bytes(b"secret")
    dataset = analytic_dataset.make_dataset(tmp_path / "root" / "scene", tmp_path / "work")
    with open_site(tmp_path / "root") as client:
        (episode,) = client.get("/api/datasets/scene").json()["episodes"]
        base = f"/api/datasets/scene/episodes/{episode['episode_id']}"
        for camera in sorted(dataset.glob("episodes/*/*/sensors/*/000000.png")):
            address = f"{base}/sensors/{camera.parent.name}/0.png"
            assert client.get(address).status_code == 200, address
            camera.unlink()
            camera.symlink_to(secret)
            answer = client.get(address)
            assert answer.status_code >= 400
            assert b"secret" not in answer.content


def test_links_that_lead_out_of_a_root_are_not_followed(tmp_path: Path) -> None:
    root, outside = tmp_path / "root", tmp_path / "outside"
    for folder in (root, outside / "town" / "commits"):
        folder.mkdir(parents=True)
    (root / "way-out").symlink_to(outside)
    roots = Roots((root,))
    assert roots.datasets() == {}
    with pytest.raises(BadInputError, match="outside"):
        roots.confine("way-out/town")
    with pytest.raises(WebError):
        roots.dataset("way-out~town")


def test_datasets_are_found_below_folders_but_not_in_hidden_ones(tmp_path: Path) -> None:
    for name in ("a", "b/c", ".hidden/d", "a b"):
        (tmp_path / name / "commits").mkdir(parents=True)
    found = Roots((tmp_path,)).datasets()
    assert {dataset.shown for dataset in found.values()} == {"a", "b/c", "a b"}
    assert {"a", "b~c"} < set(found)


def test_large_bodies_are_refused_before_they_are_parsed(site: Site) -> None:
    answer = site.client.put("/api/config", content=b"x" * (MOST_BYTES + 1))
    assert answer.status_code == 413
    pieces = (b"x" * 100_000 for _ in range(MOST_BYTES // 100_000 + 1))
    assert site.client.put("/api/config", content=pieces).status_code == 413


def test_texts_that_grow_are_refused(site: Site) -> None:
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True):
        bomb += f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n"
    deep = "a: " + "[" * 5000 + "]" * 5000
    for text in (bomb, deep, "!!python/object/apply:os.system [echo]", "\0", "a: [1"):
        answer = site.client.post("/api/config/import", json={"text": text})
        assert answer.status_code in (400, 422), text[:40]
        assert "Traceback" not in answer.text


def test_deeply_nested_json_is_no_bug(site: Site) -> None:
    body = b'{"config": {"a": ' + b"[" * 100_000 + b"]" * 100_000 + b"}}"
    answer = site.client.post(
        "/api/config/check", content=body, headers={"Content-Type": "application/json"}
    )
    assert answer.status_code in (200, 400, 422)
