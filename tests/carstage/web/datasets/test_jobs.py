"""Exports and validations go on in processes of their own."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from carstage.web.datasets.jobs import export_name
from carstage.web.messages import ExportRequest
from carstage.web.roots import Roots
from sites import Site, open_site
from waiting import await_that

pytestmark = pytest.mark.xdist_group("web")  # one site for all


def ended(client: TestClient, job_id: str) -> dict[str, Any]:
    def state() -> dict[str, Any]:
        jobs = client.get("/api/jobs").json()["jobs"]
        found: dict[str, Any] = next(job for job in jobs if job["job_id"] == job_id)
        return found

    await_that(lambda: bool(state()["state"] != "running"), 120.0)
    return state()


def test_a_dataset_is_exported_and_validated(site: Site) -> None:
    export = site.client.post(f"/api/datasets/{site.dataset}/export", json={"format": "yolo"})
    check = site.client.post(f"/api/datasets/{site.dataset}/validation")
    assert (export.status_code, check.status_code) == (201, 201)
    third = site.client.post(f"/api/datasets/{site.dataset}/validation")
    assert third.status_code == 409  # two at a time
    done = ended(site.client, export.json()["job_id"])
    assert (done["state"], done["error"]) == ("done", None)
    assert done["result"]["path"] == "exports/town-yolo"
    (warning,) = done["result"]["warnings"]
    assert "val and test are empty" in warning
    assert str(site.root) not in warning
    assert (site.root / "exports" / "town-yolo").is_dir()
    assert done["done"] == done["total"] == done["result"]["frames"]
    report = ended(site.client, check.json()["job_id"])["result"]
    validation = site.client.get(f"/api/datasets/{site.dataset}/validation").json()
    assert validation["state"] == "current"
    assert validation["report"]["ok"] == report["ok"]
    again = site.client.post(f"/api/datasets/{site.dataset}/export", json={"format": "yolo"})
    assert again.status_code == 409
    with open_site(site.root) as another:  # a new server knows of them
        assert len(another.get("/api/jobs").json()["jobs"]) == 2
    listed = site.client.get("/api/datasets").json()["datasets"]
    assert [d["dataset"] for d in listed if d["dataset"].startswith("exports")] == []


def test_formats_that_do_not_exist_are_refused(site: Site) -> None:
    answer = site.client.post(f"/api/datasets/{site.dataset}/export", json={"format": "gif"})
    assert answer.status_code == 422
    formats = site.client.get("/api/exports/formats").json()["formats"]
    assert all(entry["available"] for entry in formats)


def test_a_root_that_is_a_dataset_itself_takes_no_export_of_it(site: Site, tmp_path: Path) -> None:
    with open_site(Path(shutil.copytree(site.root / "town", tmp_path / "town"))) as client:
        answer = client.post("/api/datasets/town/export", json={"format": "yolo"})
    assert (answer.status_code, answer.json()["hint"]) == (
        409,
        "Start the interface with the folder above it, or export in a terminal.",
    )


def test_every_exporter_is_offered(site: Site) -> None:
    from carstage.exporters import exporters

    formats = site.client.get("/api/exports/formats").json()["formats"]
    assert {entry["name"] for entry in formats} == set(exporters())


def test_a_job_whose_process_is_gone_has_failed(tmp_path: Path) -> None:
    folder = tmp_path / ".carstage-gui" / "jobs" / "20260101-000000-abcdef"
    folder.mkdir(parents=True)
    job = {"kind": "export", "dataset": "x", "title": "x", "started": 1.0}
    (folder / "job.json").write_text(json.dumps({**job, "pid": 2**22 - 1, "pid_started": 1.0}))
    (folder / "status.json").write_text('{"state": "running", "done": 3, "total": 9}')
    with open_site(tmp_path) as client:
        (told,) = client.get("/api/jobs").json()["jobs"]
        assert told["state"] == "failed"
        assert "ended" in told["error"]


def test_exports_of_every_folder_get_a_name_of_their_own(tmp_path: Path) -> None:
    for name in ("a/run1", "b/run1", "müller drives"):
        (tmp_path / name / "commits").mkdir(parents=True)
    request = ExportRequest(format="coco")
    datasets = Roots([tmp_path]).datasets().values()
    names = {found.shown: export_name(found, request) for found in datasets}
    assert names["a/run1"] == "a-run1-coco"
    assert names["b/run1"] == "b-run1-coco"
    assert names["müller drives"].startswith("m_ller_drives-")
    for name in names.values():
        Roots([tmp_path]).exports(name)  # refuses what is no name
