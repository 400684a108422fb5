"""One frame of an episode: labels, pictures, masks, points."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query
from fastapi.responses import Response

from carstage.web.media import Media
from carstage.web.messages import FrameMessage
from carstage.web.messages.base import DatasetId, Name
from carstage.web.routes.access import MISSING, Access, Responses

router = APIRouter(prefix="/api/datasets/{dataset}/episodes/{episode}", tags=["frames"])

Frame = Annotated[int, Path(ge=0, le=1_000_000_000)]
Width = Annotated[int | None, Query(ge=16, le=4096, description="Scaled down to this width.")]

Sweeps = Annotated[
    int, Query(ge=1, le=20, description="Frames up to this one that are put together.")
]

_PICTURE: Responses = {200: {"content": {"image/png": {}, "image/jpeg": {}}}, **MISSING}
_POINTS: Responses = {
    200: {
        "content": {"application/octet-stream": {}},
        "description": "Little endian float32, four per point.",
    },
    **MISSING,
}
#: Committed files never change; but a re-recorded one has the same address, so not for long.
_KEEP = {"Cache-Control": "private, max-age=60", "Content-Encoding": "identity"}
"""Pictures and points are not squeezed once more: it would take longer than to send them."""


def _answer(media: Media) -> Response:
    return Response(media.content, media_type=media.kind, headers=_KEEP)


@router.get("/frames/{k}", responses=MISSING)
def frame(dataset: DatasetId, episode: Name, k: Frame, services: Access) -> FrameMessage:
    """Poses, objects, boxes and readings of a frame."""
    return services.frames.message(dataset, episode, k)


@router.get("/sensors/{sensor}/{k}.png", responses=_PICTURE, response_class=Response)
def picture(
    dataset: DatasetId,
    episode: Name,
    sensor: Name,
    k: Frame,
    services: Access,
    width: Width = None,
) -> Response:
    """A camera's picture: colour as it is; depth, tags, ids, flow in colours."""
    return _answer(services.pictures.image(dataset, episode, sensor, k, width))


@router.get("/masks/{sensor}/{k}.png", responses=_PICTURE, response_class=Response)
def masks(dataset: DatasetId, episode: Name, sensor: Name, k: Frame, services: Access) -> Response:
    """The masks of the visible objects as one transparent picture, in their classes' colours."""
    return _answer(services.pictures.masks(dataset, episode, sensor, k))


@router.get("/points/{sensor}/{k}", responses=_POINTS, response_class=Response)
def points(
    dataset: DatasetId,
    episode: Name,
    sensor: Name,
    k: Frame,
    services: Access,
    sweeps: Sweeps = 1,
) -> Response:
    """Points in the ego's axes: x, y, z and intensity (LiDAR), tag (semantic LiDAR), range rate
    (radar).
    """
    return _answer(services.pictures.points(dataset, episode, sensor, k, sweeps))
