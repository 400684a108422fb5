"""Preview through a sensor of the rig."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response

from carstage.web.messages import PreviewPending, PreviewRequest, PreviewWarm
from carstage.web.routes.access import BUSY, Access, Responses

router = APIRouter(prefix="/api", tags=["preview"])

_PICTURE: Responses = {
    200: {"content": {"image/jpeg": {}}, "description": "What the sensor sees now."},
    202: {"model": PreviewPending, "description": "Not yet: ask again in a moment."},
    **BUSY,
}


@router.post("/preview", responses=_PICTURE, response_class=Response)
def preview(request: PreviewRequest, services: Access) -> Response:
    """A picture through one sensor, from the configuration's server, which is kept for a while."""
    picture = services.sensor_preview.look(request)
    if isinstance(picture, PreviewPending):
        return JSONResponse(picture.model_dump(mode="json"), status_code=202)
    return Response(picture, media_type="image/jpeg", headers={"Cache-Control": "no-store"})


@router.post("/preview/warm", status_code=202, responses=BUSY)
def warm(request: PreviewWarm, services: Access) -> dict[str, bool]:
    """Begin to start the server, so that the first picture comes sooner."""
    return {"warm": services.sensor_preview.warm_for(request.server or {"kind": "embedded"})}
