"""Exports, validations and reports: started, listed, cancelled; they outlive this server."""

from __future__ import annotations

import json
import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from carstage.files.whole import write_whole
from carstage.runs.identity import is_alive
from carstage.runs.reading import read_document
from carstage.web.datasets.export_formats import FORMATS, available
from carstage.web.errors import WebError, not_found
from carstage.web.found_dataset import EXPORTS, FoundDataset
from carstage.web.messages import (
    ExportFormat,
    ExportFormats,
    ExportRequest,
    Job,
    ReportMessage,
    ValidationMessage,
)
from carstage.web.roots import Roots
from carstage.web.runs.launches import identify_child
from carstage.web.wording import page_words

WORKER = (sys.executable, "-m", "carstage.web.datasets.job_worker")
_MOST_RUNNING = 2
_MOST_KEPT = 50


class JobService:
    """Jobs of a state folder; safe to use from several threads.

    Args:
        folder: the state folder.
        roots: where the datasets are, and exports go.
    """

    def __init__(self, folder: Path, roots: Roots) -> None:
        self._jobs = folder / "jobs"
        self._reports = folder / "validations"
        self._roots = roots
        self._lock = threading.RLock()
        self._over: dict[str, Job] = {}
        self._pages = folder / "reports"
        for made in (self._jobs, self._reports, self._pages):
            made.mkdir(parents=True, exist_ok=True)

    def all(self) -> list[Job]:
        """All, newest first."""
        with self._lock:
            names = sorted(path.parent.name for path in self._jobs.glob("*/job.json"))
            jobs = [job for name in names[-_MOST_KEPT:] if (job := self._job(name)) is not None]
        return sorted(jobs, key=lambda job: job.started, reverse=True)

    def formats(self) -> ExportFormats:
        """What can be exported to."""
        return ExportFormats(
            formats=[
                ExportFormat(
                    name=name,
                    title=title,
                    available=available(extra),
                    extra=None if available(extra) else extra,
                )
                for name, (title, extra) in FORMATS.items()
            ]
        )

    def export(self, dataset: str, request: ExportRequest) -> Job:
        """Begin an export.

        Raises:
            WebError: no such dataset or format, there is an export of that name, or exports would
                lie in the dataset.
        """
        found = self._roots.dataset(dataset)
        if request.format not in FORMATS:
            raise WebError(
                422,
                f"There is no format {request.format}.",
                f"Formats: {', '.join(FORMATS)}.",
            )
        name = export_name(found, request)
        target = self._roots.exports(name)
        if str(target).startswith(f"{found.path}/"):
            raise WebError(
                409,
                f"Exports are made in {found.shown} itself, and none may lie in its dataset.",
                "Start the interface with the folder above it, or export in a terminal.",
            )
        if target.exists() and not request.overwrite:
            raise WebError(
                409, f"{EXPORTS}/{name} exists already.", "Choose another name, or overwrite it."
            )
        if self.writes(name):
            raise WebError(
                409, f"{EXPORTS}/{name} is being written.", "Wait for its end, or cancel it first."
            )
        options = request.model_dump(exclude={"format", "out", "overwrite", "allow_incomplete"})
        return self._begin(
            {
                "kind": "export",
                "title": f"{FORMATS[request.format][0]} of {found.shown}",
                "format": request.format,
                "out": str(target),
                "shown": f"{EXPORTS}/{name}",
                "overwrite": request.overwrite,
                "allow_incomplete": request.allow_incomplete,
                "options": options,
            },
            found,
        )

    def validate(self, dataset: str) -> Job:
        """Begin a validation.

        Raises:
            WebError: there is no such dataset.
        """
        found = self._roots.dataset(dataset)
        return self._begin(
            {
                "kind": "validation",
                "title": f"Validation of {found.shown}",
                "report": str(self._report(found)),
                "fingerprint": found.fingerprint(),
            },
            found,
        )

    def make_report(self, dataset: str) -> Job:
        """Begin to write the report of a dataset.

        Raises:
            WebError: there is no such dataset.
        """
        found = self._roots.dataset(dataset)
        return self._begin(
            {
                "kind": "report",
                "title": f"Report of {found.shown}",
                "out": str(self._pages / f"{found.dataset}.html"),
                "fingerprint": found.fingerprint(),
            },
            found,
        )

    def report(self, dataset: str) -> ReportMessage:
        """Whether there is a report, and whether the dataset is still the same.

        Raises:
            WebError: there is no such dataset.
        """
        found = self._roots.dataset(dataset)
        if self._running("report", dataset) is not None:
            return ReportMessage(state="running")
        kept = read_document(self._pages / f"{found.dataset}.json")
        if kept is None:
            return ReportMessage(state="none")
        current = kept.get("fingerprint") == found.fingerprint()
        return ReportMessage(state="current" if current else "outdated", made=kept.get("made"))

    def report_page(self, dataset: str) -> bytes:
        """The report, as HTML.

        Raises:
            WebError: there is no such dataset, or no report of it.
        """
        found = self._roots.dataset(dataset)
        try:
            return (self._pages / f"{found.dataset}.html").read_bytes()
        except OSError:
            raise not_found(f"report of dataset {dataset}") from None

    def _running(self, kind: str, dataset: str) -> Job | None:
        return next(
            (
                job
                for job in self.all()
                if (job.kind, job.dataset, job.state) == (kind, dataset, "running")
            ),
            None,
        )

    def validation(self, dataset: str) -> ValidationMessage:
        """What the last validation found, and whether the dataset is still the same.

        Raises:
            WebError: there is no such dataset.
        """
        found = self._roots.dataset(dataset)
        running = self._running("validation", dataset)
        kept = read_document(self._report(found))
        if kept is None:
            return ValidationMessage(state="running" if running else "none", job=running)
        current = kept.get("fingerprint") == found.fingerprint()
        return ValidationMessage(
            state="running" if running else "current" if current else "outdated",
            job=running,
            report=kept.get("report"),
            validated=kept.get("validated"),
        )

    def validity(self, found: FoundDataset) -> str:
        """``valid``, ``invalid``, ``outdated`` or ``unknown``."""
        kept = read_document(self._report(found))
        if kept is None:
            return "unknown"
        if kept.get("fingerprint") != found.fingerprint():
            return "outdated"
        return "valid" if kept.get("report", {}).get("ok") else "invalid"

    def cancel(self, job_id: str) -> Job:
        """End a job by its own process.

        Raises:
            WebError: there is none of that id.
        """
        with self._lock:
            job = self._job(job_id)
            if job is None:
                raise not_found(f"job {job_id}")
            document = read_document(self._jobs / job_id / "job.json")
            if document is not None and job.state == "running" and is_alive(document):
                with suppress(ProcessLookupError):
                    os.kill(int(document["pid"]), signal.SIGTERM)
        return job

    def uses(self, dataset: str) -> bool:
        """Whether a job reads a dataset now."""
        return any(job.dataset == dataset and job.state == "running" for job in self.all())

    def writes(self, name: str) -> bool:
        """Whether a job writes an export of this name now."""
        running = {job.job_id for job in self.all() if job.state == "running"}
        documents = (read_document(self._jobs / job_id / "job.json") or {} for job_id in running)
        return any(document.get("shown") == f"{EXPORTS}/{name}" for document in documents)

    def forget(self, found: FoundDataset) -> None:
        """Forget what was found about a dataset that is gone."""
        self._report(found).unlink(missing_ok=True)
        for suffix in (".html", ".json"):
            (self._pages / f"{found.dataset}{suffix}").unlink(missing_ok=True)

    def _begin(self, job: dict[str, Any], found: FoundDataset) -> Job:
        with self._lock:
            running = [job for job in self.all() if job.state == "running"]
            if len(running) >= _MOST_RUNNING:
                raise WebError(
                    409, f"{_MOST_RUNNING} jobs are running.", "Wait for one, or cancel one."
                )
            job_id = f"{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}-{secrets.token_hex(3)}"
            folder = self._jobs / job_id
            folder.mkdir()
            document = {
                **job,
                "dataset": found.dataset,
                "path": str(found.path),
                "started": time.time(),
            }
            write_whole(folder / "job.json", json.dumps(document).encode())
            with (folder / "output.log").open("ab") as log:
                child = subprocess.Popen(
                    [*WORKER, str(folder)],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    start_new_session=True,
                )
            threading.Thread(target=child.wait, name=f"job {job_id}", daemon=True).start()
            document |= identify_child(child.pid)
            write_whole(folder / "job.json", json.dumps(document).encode())
            begun = self._job(job_id)
            assert begun is not None
            return begun

    def _job(self, job_id: str) -> Job | None:
        if job_id in self._over:
            return self._over[job_id]
        folder = self._jobs / job_id
        document = read_document(folder / "job.json")
        if document is None:
            return None
        status = read_document(folder / "status.json") or {}
        state, error = status.get("state", "running"), status.get("error")
        if state == "running" and "pid" in document and not is_alive(document):
            status = read_document(folder / "status.json") or {}  # it may have ended just now
            state, error = status.get("state"), status.get("error")
            if state in (None, "running"):
                state, error = "failed", "Its process ended without a word."
        job = Job(
            job_id=job_id,
            kind=document["kind"],
            dataset=document["dataset"],
            title=document["title"],
            state=state,
            phase=status.get("phase", ""),
            done=status.get("done", 0),
            total=status.get("total", 0),
            started=document["started"],
            ended=status.get("ended"),
            result=status.get("result"),
            error=page_words(error) if isinstance(error, str) else error,
        )
        if job.state != "running":
            self._over[job_id] = job
        return job

    def _report(self, found: FoundDataset) -> Path:
        return self._reports / f"{found.dataset}.json"


def export_name(found: FoundDataset, request: ExportRequest) -> str:
    """The name of the folder that an export is made in; the dataset's id has no odd letters."""
    return request.out or f"{found.dataset.replace('~', '-')}-{request.format}"
