"""The routes below ``/api``, one module per subject."""

from carstage.web.routes.config import router as config_router
from carstage.web.routes.datasets import router as datasets_router
from carstage.web.routes.description import router as description_router
from carstage.web.routes.frames import router as frames_router
from carstage.web.routes.jobs import router as jobs_router
from carstage.web.routes.live import router as live_router
from carstage.web.routes.runs import router as runs_router
from carstage.web.routes.sensor_preview import router as sensor_preview_router

ROUTERS = (
    config_router,
    description_router,
    sensor_preview_router,
    runs_router,
    datasets_router,
    frames_router,
    jobs_router,
    live_router,
)

__all__ = ["ROUTERS"]
