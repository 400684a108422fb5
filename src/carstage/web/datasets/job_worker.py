"""``python -m carstage.web.datasets.job_worker JOB_FOLDER``: one export, validation or report.

A separate process: it goes on when the server ends, and its memory is freed when it is done.
``JOB_FOLDER/job.json`` is the order; ``status.json``, replaced as a whole, the progress.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

from carstage.errors import CarStageError
from carstage.files.whole import write_whole
from carstage.storage.address import dataset_root

_WRITE_EVERY_S = 0.25


class Status:
    """The job's ``status.json``."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._document: dict[str, Any] = {"state": "running", "phase": "", "done": 0, "total": 0}
        self._next_s = 0.0

    def write(self, **changes: Any) -> None:
        """Replace the file with these values changed."""
        self._document.update(changes)
        write_whole(self._path, json.dumps(self._document).encode())

    def progress(self, phase: str, done: int, total: int) -> None:
        """Write how far a phase is, a few times a second."""
        now_s = time.monotonic()
        if phase != self._document["phase"] or now_s >= self._next_s or done == total:
            self._next_s = now_s + _WRITE_EVERY_S
            self.write(phase=phase, done=done, total=total)


def main(folder: Path) -> int:
    """Do the job; exit code 0 when it was done."""
    # Ends like Ctrl-C does: what an export has begun is removed on the way out.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    job = json.loads((folder / "job.json").read_bytes())
    status = Status(folder / "status.json")
    try:
        status.write()
        work = {"export": _export, "validation": _validate, "report": _report}[job["kind"]]
        result = work(job, status)
    except KeyboardInterrupt:
        status.write(state="cancelled", ended=time.time())
        return 130
    except CarStageError as error:
        status.write(state="failed", error=str(error), ended=time.time())
        return 1
    except OSError as error:
        words = f"The file system refused: {error.strerror or error}."
        status.write(state="failed", error=words, ended=time.time())
        return 1
    status.write(state="done", result=result, ended=time.time())
    return 0


def _export(job: dict[str, Any], status: Status) -> dict[str, Any]:
    from carstage.exporters import ExportOptions, export_dataset

    given = dict(job["options"])
    options = ExportOptions(
        **{
            **given,
            "cameras": tuple(given["cameras"]),
            "classes": tuple(given["classes"]),
            "episodes": tuple(given["episodes"]),
        }
    )
    target = dataset_root(job["out"])
    if isinstance(target, Path):
        target.parent.mkdir(exist_ok=True)
    summary = export_dataset(
        job["format"],
        job["path"],
        target,
        options,
        overwrite=job["overwrite"],
        allow_incomplete=job["allow_incomplete"],
        progress=status.progress,
    )
    return {**summary.to_json(), "path": job["shown"]}


def _report(job: dict[str, Any], status: Status) -> dict[str, Any]:
    from carstage.report import write_report
    from carstage.validation import validate_dataset

    verdict = validate_dataset(job["path"], progress=partial(status.progress, "Checking"))
    status.progress("Drawing", 0, 0)
    out = Path(job["out"])
    write_report(job["path"], out, validation=verdict)
    kept = {"made": time.time(), "fingerprint": job["fingerprint"]}
    write_whole(out.with_suffix(".json"), json.dumps(kept).encode())
    return {"ok": verdict.ok}


def _validate(job: dict[str, Any], status: Status) -> dict[str, Any]:
    from carstage.validation import validate_dataset

    report = validate_dataset(job["path"], progress=partial(status.progress, "Checking"))
    document = json.loads(report.to_json())
    temporary = Path(job["report"]).with_suffix(".part")
    temporary.write_text(
        json.dumps(
            {"report": document, "validated": time.time(), "fingerprint": job["fingerprint"]}
        ),
        "utf-8",
    )
    temporary.replace(job["report"])
    severities = [problem["severity"] for problem in document["problems"]]
    return {
        "ok": document["ok"],
        "errors": severities.count("error"),
        "warnings": severities.count("warning"),
    }


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
