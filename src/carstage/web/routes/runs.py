"""Runs: the list with its queue, starting, stopping."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.responses import StreamingResponse

from carstage.web.messages import (
    RunAgain,
    RunChange,
    RunComparison,
    RunDetail,
    RunList,
    RunStart,
    RunStop,
    RunSummary,
)
from carstage.web.messages.base import RunId
from carstage.web.messages.runs import MOST_COMPARED
from carstage.web.routes.access import ARCHIVE, BUSY, MISSING, Access, archive
from carstage.web.runs.comparison import compare_runs

Compared = Annotated[
    list[RunId],
    Query(min_length=2, max_length=MOST_COMPARED, description="Which runs; give it repeatedly."),
]

router = APIRouter(prefix="/api", tags=["runs"])


@router.get("/runs")
def runs(services: Access) -> RunList:
    """All runs of all datasets, newest first, queued ones before."""
    return RunList(runs=services.runs.summaries())


@router.post("/runs", status_code=201, responses=BUSY)
def start(request: RunStart, services: Access) -> RunSummary:
    """Begin a run, or queue it behind the one that goes on."""
    return services.runs.start(request)


@router.get("/runs/{run_id}", responses=MISSING)
def run(run_id: RunId, services: Access) -> RunDetail:
    """A run with its configuration, log and tick times."""
    return services.runs.detail(run_id)


@router.get("/comparison", responses=BUSY)
def comparison(run: Compared, services: Access) -> RunComparison:
    """Several runs: what each took, its load over time, and the settings that differ."""
    return compare_runs(services.runs, run)


@router.post("/runs/{run_id}/stop", responses=BUSY)
def stop(run_id: RunId, services: Access, request: RunStop | None = None) -> RunSummary:
    """Stop: the first time the frame is finished, the second time it ends at once.

    A queued run leaves the queue.
    """
    return services.runs.stop(run_id, None if request is None else request.seen)


@router.post("/runs/{run_id}/again", status_code=201, responses=BUSY)
def again(run_id: RunId, request: RunAgain, services: Access) -> RunSummary:
    """Go on with a run that has ended, or record the same into another dataset."""
    return services.runs.again(run_id, request)


@router.patch("/runs/{run_id}", responses=MISSING)
def rename_run(run_id: RunId, change: RunChange, services: Access) -> RunSummary:
    """Show a run by another name."""
    return services.runs.rename(run_id, change.name)


@router.delete("/runs/{run_id}", status_code=204, response_model=None, responses=BUSY)
def remove_run(run_id: RunId, services: Access) -> None:
    """Remove a run with its logs; its episodes stay in the dataset."""
    services.runs.remove(run_id)


@router.get("/runs/{run_id}/files.zip", responses=ARCHIVE, response_class=StreamingResponse)
def run_files(run_id: RunId, services: Access) -> StreamingResponse:
    """The run's own folder: plan, status, events, logs."""
    return archive(f"run-{run_id}", services.runs.archive(run_id))
