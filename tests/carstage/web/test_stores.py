"""The interface over an object store: datasets are listed, played, validated, exported there."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from analytic_dataset import make_dataset
from carstage import Dataset, validate
from carstage.cache import CACHE_VARIABLE
from carstage.runs.launching import RunOptions
from carstage.storage.remote_files import remote_files
from carstage.storage.remote_path import RemotePath
from object_stores import ObjectServer, moto
from sites import HERE
from waiting import await_that

pytestmark = pytest.mark.xdist_group("stores of the page")  # one store

SECRET = "secret-of-the-bucket"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with moto(tmp_path_factory.mktemp("moto")) as made:
        yield made


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("local")
    return make_dataset(folder / "town", folder / "work")


@pytest.fixture
def root(
    server: ObjectServer, local: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[RemotePath]:
    """A place in a bucket with the dataset ``town``."""
    for name in os.environ:
        if name.startswith("AWS_"):
            monkeypatch.delenv(name)
    for name, value in {**server.environment, "AWS_SECRET_ACCESS_KEY": SECRET}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    remote_files.cache_clear()
    place = RemotePath(f"{server.address}/{tmp_path.name}")
    files = remote_files(f"{place}/town")
    for path in sorted(local.rglob("*")):
        if path.is_file():
            files.write(path.relative_to(local).as_posix(), path)
    yield place
    remote_files.cache_clear()


@pytest.fixture
def client(root: RemotePath) -> Iterator[TestClient]:
    from carstage.web.app import create_app
    from carstage.web.loading import load
    from carstage.web.settings import WebSettings

    load()
    with TestClient(create_app(WebSettings(roots=(root,))), base_url=HERE) as made:
        yield made


def job_ended(client: TestClient, job: dict[str, Any]) -> dict[str, Any]:
    def now() -> dict[str, Any]:
        jobs = client.get("/api/jobs").json()["jobs"]
        found: dict[str, Any] = next(one for one in jobs if one["job_id"] == job["job_id"])
        return found

    await_that(lambda: bool(now()["state"] != "running"), 120.0)
    return now()


def test_a_dataset_in_a_store_is_listed_and_played(
    client: TestClient, root: RemotePath, local: Path
) -> None:
    # The first answer waits for the store only for a while.
    await_that(lambda: bool(client.get("/api/datasets").json()["datasets"]), 60.0)
    listed = client.get("/api/datasets").json()
    (town,) = listed["datasets"]
    assert (town["dataset"], town["episodes"], town["state"]) == ("town", 1, "ready")
    assert town["location"] == f"{root}/town"
    assert (listed["root"], listed["problems"]) == (str(root), [])
    detail = client.get("/api/datasets/town").json()
    (episode,) = detail["episodes"]
    assert episode["number"] == 1
    base = f"/api/datasets/town/episodes/{episode['episode_id']}"
    rig = client.get(base).json()["sensors"]
    frame = client.get(f"{base}/frames/0").json()
    assert frame["objects"]
    camera = next(one["id"] for one in rig if one["data"] == "image")
    picture = client.get(f"{base}/sensors/{camera}/0.png")
    (here,) = Dataset(local).episodes
    assert picture.content == here.sensor(camera).paths(0)[0].read_bytes()
    for part in ("map", "ego"):
        assert client.get(f"{base}/{part}").status_code == 200
    rows = client.post("/api/datasets/town/table", json={"table": "objects"}).json()
    assert rows["total"] > 0
    counted = client.get("/api/datasets/town/statistics").json()["records"]
    assert 0 < counted < rows["total"]  # but for the ego's own rows


def test_it_is_validated_exported_sent_and_removed(client: TestClient, root: RemotePath) -> None:
    check = client.post("/api/datasets/town/validation")
    export = client.post("/api/datasets/town/export", json={"format": "yolo"})
    assert (check.status_code, export.status_code) == (201, 201), export.text
    assert job_ended(client, check.json())["state"] == "done"
    assert client.get("/api/datasets/town/validation").json()["state"] == "current"
    done = job_ended(client, export.json())
    assert (done["state"], done["error"]) == ("done", None)
    (entry,) = client.get("/api/exports").json()["exports"]
    assert entry["location"] == f"{root}/exports/town-yolo"
    assert (root / "exports" / "town-yolo" / "export.json").is_file()
    sent = zipfile.ZipFile(io.BytesIO(client.get("/api/datasets/town/files.zip").content))
    assert "town/dataset.json" in sent.namelist()
    assert sent.testzip() is None
    assert client.patch("/api/datasets/town", json={"name": "Rain"}).json()["name"] == "Rain"
    assert client.patch("/api/exports/town-yolo", json={"name": "x"}).status_code == 409
    assert client.delete("/api/exports/town-yolo").status_code == 204
    assert client.get("/api/exports").json()["exports"] == []
    assert client.delete("/api/datasets/town").json() == {"left": []}
    assert client.get("/api/datasets").json()["datasets"] == []
    assert remote_files(str(root)).below("") == []


def test_a_run_may_record_into_a_store(
    client: TestClient,
    root: RemotePath,
    demo: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[tuple[str, RunOptions]] = []

    def start(
        config: Path, out: str, run_id: str, log: Path, *, options: RunOptions, folder: Path
    ) -> subprocess.Popen[bytes]:
        del config, run_id, folder
        seen.append((out, options))
        with log.open("ab") as output:
            words = f"import sys; sys.exit('Error: stopped. {out}')"
            return subprocess.Popen([sys.executable, "-c", words], stderr=output)

    monkeypatch.setattr("carstage.runs.launching.launch", start)
    asked = {"config": demo, "workers": 2, "catalog": "postgresql://reader@db/catalog"}
    for place in ("drive", f"{root}-elsewhere/drive"):
        answer = client.post("/api/runs", json={**asked, "dataset": place})
        assert answer.status_code == 201, answer.text
        run_id = answer.json()["run_id"]
        await_that(
            lambda run_id=run_id: bool(
                client.get(f"/api/runs/{run_id}").json()["run"]["alive"] == "ended"
            )
        )
    assert [out for out, _ in seen] == [f"{root}/drive", f"{root}-elsewhere/drive"]
    assert seen[0][1] == RunOptions(workers=2, catalog="postgresql://reader@db/catalog")
    refused = [
        {"catalog": f"postgresql://reader:{SECRET}@db/catalog"},
        {"catalog": "sqlite:////etc/catalog.sqlite"},
        {"dataset": "s3://no-such-bucket/x"},
        {"dataset": f"s3://user:{SECRET}@bucket/x"},
        {"dataset": "https://example.com/x"},
        {"work": "/etc"},
        {"workers": 0},
    ]
    for change in refused:
        answer = client.post("/api/runs", json={**asked, "dataset": "drive", **change})
        assert answer.status_code in (400, 409, 422), change
        assert SECRET not in answer.text
    assert len(seen) == 2


def test_no_secret_reaches_the_page(
    client: TestClient, demo: dict[str, Any], root: RemotePath
) -> None:
    pages = ["/api/datasets", "/api/datasets/town", "/api/runs", "/api/jobs", "/api/exports"]
    texts = [client.get(page).text for page in pages]
    command = {"do": "start", "run": {"dataset": "drive", "config": demo}}
    texts.append(client.post("/api/command", json={"command": command}).text)
    assert f"--out {root}/drive" in json.loads(texts[-1])["text"]
    assert all(SECRET not in text for text in texts)


def test_a_store_that_is_away_is_told_and_stops_nothing(
    client: TestClient, root: RemotePath, monkeypatch: pytest.MonkeyPatch
) -> None:
    from carstage.errors import StoreAccessError
    from carstage.web.remote_roots import RemoteRoot

    now = [0.0]
    place = RemoteRoot(root, 0, lambda: now[0])
    assert [one.dataset for one in place.datasets()] == ["town"]

    def refuse(self: object, key: str) -> Any:
        del self, key
        raise StoreAccessError("The store lets nobody look.", "Set the credentials.")

    monkeypatch.setattr("carstage.storage.remote_files.RemoteFiles.listing", refuse)
    now[0] = 100.0
    await_that(lambda: place.datasets() != () and place.problem != "")
    assert [one.dataset for one in place.datasets()] == ["town"]  # as it was seen last
    assert place.problem == "The store lets nobody look. Set the credentials."


def test_datasets_in_a_root_that_is_one_itself_are_listed(root: RemotePath) -> None:
    from carstage.web.remote_roots import RemoteRoot

    place = RemotePath(f"{root}-one")
    files = remote_files(str(place))
    for folder in ("commits", "drive/commits", "drive/inner/commits", "episodes/e/commits"):
        files.write(f"{folder}/0123456789abcdef.json", b"{}")
    found = RemoteRoot(place, 0).datasets()
    assert [one.path for one in found] == [place, RemotePath(f"{place}/drive")]


def test_a_bucket_that_is_not_there_is_refused_at_the_start(root: RemotePath) -> None:
    command = [sys.executable, "-m", "carstage.cli", "gui", "--no-browser", "--port", "0"]
    ended = subprocess.run(
        [*command, "--datasets", "s3://no-such-bucket/x"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 2, ended.stderr
    assert "no-such-bucket" in ended.stderr
    assert SECRET not in ended.stderr
    assert validate(f"{root}/town").ok
