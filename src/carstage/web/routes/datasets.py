"""Datasets: list, detail, label tables, statistics."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.responses import StreamingResponse

from carstage.web.datasets.history import NEAR_M
from carstage.web.messages import (
    CampaignList,
    DatasetChange,
    DatasetDetail,
    DatasetList,
    DatasetSummary,
    EgoSignals,
    EpisodeDetail,
    EpisodeHistory,
    EpisodeMap,
    Removed,
    Statistics,
    TablePage,
    TableRequest,
)
from carstage.web.messages.base import DatasetId, Name
from carstage.web.routes.access import ARCHIVE, BUSY, MISSING, Access, archive

Near = Annotated[float, Query(gt=0, le=1000, description="From where on one is near, m.")]

router = APIRouter(prefix="/api/datasets", tags=["datasets"])


@router.get("")
def datasets(services: Access) -> DatasetList:
    """All datasets below the roots."""
    return services.datasets.all()


@router.get("/{dataset}", responses=MISSING)
def dataset(dataset: DatasetId, services: Access) -> DatasetDetail:
    """A dataset with its episodes and colours."""
    return services.datasets.detail(dataset)


@router.get("/{dataset}/episodes/{episode}", responses=MISSING)
def episode(dataset: DatasetId, episode: Name, services: Access) -> EpisodeDetail:
    """An episode: rig, times, what was asked for."""
    return services.episodes.detail(dataset, episode)


@router.get("/{dataset}/episodes/{episode}/map", responses=MISSING)
def episode_map(dataset: DatasetId, episode: Name, services: Access) -> EpisodeMap:
    """Lanes of the map and the ego's track, for the top view."""
    return services.episodes.map(dataset, episode)


@router.get("/{dataset}/episodes/{episode}/ego", responses=MISSING)
def episode_ego(dataset: DatasetId, episode: Name, services: Access) -> EgoSignals:
    """How the ego drove, frame by frame, for the plots."""
    return services.episodes.ego(dataset, episode)


@router.get("/{dataset}/episodes/{episode}/history", responses=MISSING)
def episode_history(
    dataset: DatasetId, episode: Name, services: Access, near_m: Near = NEAR_M
) -> EpisodeHistory:
    """Tracks, lights, weather and faults over time, and moments to jump to."""
    return services.history.history(dataset, episode, near_m)


@router.post("/{dataset}/table", responses=MISSING)
def table(dataset: DatasetId, request: TableRequest, services: Access) -> TablePage:
    """A page of a label table, filtered and sorted."""
    return services.tables.page(dataset, request)


@router.get("/{dataset}/statistics", responses=MISSING)
def statistics(dataset: DatasetId, services: Access) -> Statistics:
    """Counts over the labels."""
    return services.tables.statistics(dataset)


@router.get("/{dataset}/campaigns", responses=MISSING)
def campaigns(dataset: DatasetId, services: Access) -> CampaignList:
    """How far the campaigns are that have been recorded into a dataset."""
    return services.campaigns.all(dataset)


@router.patch("/{dataset}", responses=BUSY)
def rename_dataset(dataset: DatasetId, change: DatasetChange, services: Access) -> DatasetSummary:
    """Give a dataset another name; its folder stays."""
    return services.datasets.rename(dataset, change.name)


@router.delete("/{dataset}", responses=BUSY)
def remove_dataset(dataset: DatasetId, services: Access) -> Removed:
    """Remove a dataset with its episodes and runs."""
    return services.remove_dataset(dataset)


@router.get("/{dataset}/files.zip", responses=ARCHIVE, response_class=StreamingResponse)
def dataset_files(dataset: DatasetId, services: Access) -> StreamingResponse:
    """The dataset as it is, without its runs."""
    return archive(dataset, services.datasets.archive(dataset))
