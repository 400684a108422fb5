"""Work on datasets that takes a while: exports and validations."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from carstage.web.messages.base import DatasetId, Document, Message, Name

JobId = Name


class ExportFormat(Message):
    """A format that a dataset can be written in.

    Attributes:
        extra: the extra of the package that it needs, if it is not installed.
    """

    name: str
    title: str
    available: bool
    extra: str | None = None


class ExportFormats(Message):
    """All formats."""

    formats: list[ExportFormat]


class ExportRequest(Message):
    """An export to begin; the options are those of ``carstage export``.

    Attributes:
        episodes: which to export; none: all.
        out: name of the folder that is made beside the dataset's; left out: ``DATASET-FORMAT``.
    """

    format: Name
    episodes: Annotated[list[Name], Field(max_length=10_000)] = Field(default_factory=list)
    out: Name | None = None
    overwrite: bool = False
    allow_incomplete: bool = False
    cameras: list[Name] = Field(default_factory=list)
    lidar: Name | None = None
    boxes: Literal["amodal", "modal"] | None = None
    occlusion: Literal["stage_vo", "pixel"] | None = None
    min_lidar_points: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    max_distance_m: Annotated[float, Field(gt=0, le=100_000)] | None = None
    include_invisible: bool = False
    val_share: Annotated[float, Field(ge=0, lt=1)] | None = None
    test_share: Annotated[float, Field(ge=0, lt=1)] | None = None
    codec: Literal["ffv1", "h264"] | None = None
    classes: list[Name] = Field(default_factory=list)
    categories: Literal["own", "coco80"] | None = None


class ExportEntry(Message):
    """An export that is there.

    Attributes:
        dataset: name of the dataset that it was made of.
        changed: Unix time at which it was whole.
        location: its folder, or its address.
    """

    name: str
    format: str
    dataset: str
    frames: int
    bytes: int
    changed: float
    location: str


class ExportList(Message):
    """All exports, newest first."""

    exports: list[ExportEntry]


class ExportChange(Message):
    """A new name for an export's folder."""

    name: Name


class Job(Message):
    """An export, a validation or a report.

    Attributes:
        done, total: frames; ``total`` 0: not known yet.
        result: of an export its summary; of a validation ``ok`` and counts.
        error: why it failed, in a sentence.
    """

    job_id: JobId
    kind: Literal["export", "validation", "report"]
    dataset: DatasetId
    title: str
    state: Literal["running", "done", "failed", "cancelled"]
    phase: str = ""
    done: int = 0
    total: int = 0
    started: float
    ended: float | None = None
    result: Document | None = None
    error: str | None = None


class JobList(Message):
    """All jobs, newest first."""

    jobs: list[Job]


class ReportMessage(Message):
    """Whether there is a report of a dataset.

    Attributes:
        state: ``outdated``: episodes have come or gone since.
    """

    state: Literal["none", "running", "current", "outdated"]
    made: float | None = None


class ValidationMessage(Message):
    """What is known about a dataset's validity.

    Attributes:
        state: ``none``: never validated here; ``outdated``: episodes have come or gone since.
        report: as ``carstage validate --json`` prints it.
    """

    state: Literal["none", "running", "current", "outdated"]
    job: Job | None = None
    report: dict[str, Any] | None = None
    validated: float | None = None
