"""Exports and validations, which go on in processes of their own."""

from __future__ import annotations

from fastapi import APIRouter

from carstage.web.messages import (
    ExportFormats,
    ExportRequest,
    Job,
    JobList,
    ValidationMessage,
)
from carstage.web.messages.base import DatasetId
from carstage.web.messages.jobs import JobId
from carstage.web.routes.access import BUSY, MISSING, Access

router = APIRouter(prefix="/api", tags=["jobs"])


@router.get("/exports/formats")
def formats(services: Access) -> ExportFormats:
    """The formats that a dataset can be exported to."""
    return services.jobs.formats()


@router.post("/datasets/{dataset}/export", status_code=201, responses=BUSY)
def export(dataset: DatasetId, request: ExportRequest, services: Access) -> Job:
    """Begin an export; its progress comes over the WebSocket."""
    return services.jobs.export(dataset, request)


@router.post("/datasets/{dataset}/validation", status_code=201, responses=BUSY)
def validate(dataset: DatasetId, services: Access) -> Job:
    """Begin to validate a dataset."""
    return services.jobs.validate(dataset)


@router.get("/datasets/{dataset}/validation", responses=MISSING)
def validation(dataset: DatasetId, services: Access) -> ValidationMessage:
    """What the last validation found."""
    return services.jobs.validation(dataset)


@router.get("/jobs")
def jobs(services: Access) -> JobList:
    """All exports and validations, newest first."""
    return JobList(jobs=services.jobs.all())


@router.post("/jobs/{job_id}/cancel", responses=MISSING)
def cancel(job_id: JobId, services: Access) -> Job:
    """End a job; what it has written goes."""
    return services.jobs.cancel(job_id)
