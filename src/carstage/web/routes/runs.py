"""Runs: the list with its queue, starting, stopping."""

from __future__ import annotations

from fastapi import APIRouter

from carstage.web.messages import RunDetail, RunList, RunStart, RunSummary
from carstage.web.messages.base import RunId
from carstage.web.routes.access import BUSY, MISSING, Access

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


@router.post("/runs/{run_id}/stop", responses=BUSY)
def stop(run_id: RunId, services: Access) -> RunSummary:
    """Stop: the first time the frame is finished, the second time it ends at once.

    A queued run leaves the queue.
    """
    return services.runs.stop(run_id)
