"""Exports, validations and reports, which go on in processes of their own."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import Response, StreamingResponse

from carstage.web.messages import (
    CommandRequest,
    CommandText,
    ExportChange,
    ExportEntry,
    ExportFormats,
    ExportList,
    ExportRequest,
    Job,
    JobList,
    ReportMessage,
    ValidationMessage,
)
from carstage.web.messages.base import DatasetId, Name
from carstage.web.messages.jobs import JobId
from carstage.web.routes.access import ARCHIVE, BAD, BUSY, MISSING, Access, Responses, archive

router = APIRouter(prefix="/api", tags=["jobs"])

_PAGE: Responses = {200: {"content": {"text/html": {}}}, **MISSING}
_ALONE = {
    "Content-Security-Policy": "default-src 'none'; img-src data:; media-src data:; "
    "style-src 'unsafe-inline'; frame-ancestors 'self'; sandbox",
    "Cache-Control": "no-cache",
}
"""The report shows what a dataset says: it may load nothing, run nothing, and be framed here."""


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


@router.post("/datasets/{dataset}/report", status_code=201, responses=BUSY)
def make_report(dataset: DatasetId, services: Access) -> Job:
    """Begin to write the report of a dataset."""
    return services.jobs.make_report(dataset)


@router.get("/datasets/{dataset}/report", responses=MISSING)
def report(dataset: DatasetId, services: Access) -> ReportMessage:
    """Whether there is a report, and of which state of the dataset."""
    return services.jobs.report(dataset)


@router.get("/datasets/{dataset}/report.html", responses=_PAGE, response_class=Response)
def report_page(dataset: DatasetId, services: Access) -> Response:
    """The report: one page on its own, without scripts."""
    return Response(services.jobs.report_page(dataset), media_type="text/html", headers=_ALONE)


@router.get("/exports", responses=BAD)
def exports(services: Access) -> ExportList:
    """All exports that are there, newest first."""
    return services.exports.all()


@router.patch("/exports/{name}", responses=BUSY)
def rename_export(name: Name, change: ExportChange, services: Access) -> ExportEntry:
    """Give an export's folder another name."""
    return services.exports.rename(name, change.name)


@router.delete("/exports/{name}", status_code=204, response_model=None, responses=BUSY)
def remove_export(name: Name, services: Access) -> None:
    """Remove an export."""
    services.exports.remove(name)


@router.get("/exports/{name}/files.zip", responses=ARCHIVE, response_class=StreamingResponse)
def export_files(name: Name, services: Access) -> StreamingResponse:
    """An export as one file."""
    return archive(name, services.exports.archive(name))


@router.post("/command", responses=MISSING)
def command(request: CommandRequest, services: Access) -> CommandText:
    """The command that does the same in a shell on the server's machine; nothing is done."""
    return services.commands.text(request)


@router.get("/jobs")
def jobs(services: Access) -> JobList:
    """All exports and validations, newest first."""
    return JobList(jobs=services.jobs.all())


@router.post("/jobs/{job_id}/cancel", responses=MISSING)
def cancel(job_id: JobId, services: Access) -> Job:
    """End a job; what it has written goes."""
    return services.jobs.cancel(job_id)
