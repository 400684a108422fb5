"""The application: guards, errors, routes, the built page."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse, Response
from fastapi.staticfiles import StaticFiles
from starlette.middleware.gzip import GZipMiddleware

from carstage import __version__
from carstage.files.bounded import reading_within
from carstage.web import errors
from carstage.web.errors import WebError, answer
from carstage.web.limits import BodyLimit, WorkLimit
from carstage.web.routes import ROUTERS
from carstage.web.security import Guard
from carstage.web.services import Services
from carstage.web.settings import WebSettings

STATIC = Path(__file__).parent / "static"
_GZIP_FROM_BYTES = 1000


def create_app(settings: WebSettings, *, static: Path = STATIC) -> FastAPI:
    """The application; its services live from start-up to shutdown.

    Args:
        settings: address, roots, token.
        static: folder of the built page.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        # Of what reads for every browser at once; what answers one is confined by the guard.
        with reading_within(settings.folders):
            async with Services.running(settings) as services:
                app.state.services = services
                yield

    app = FastAPI(
        title="Car-STAGE",
        version=__version__,
        description="What the graphical interface speaks; see docs/gui.md.",
        lifespan=lifespan,
        # The pages that show it load their scripts from elsewhere; the document itself is served.
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        generate_unique_id_function=lambda route: route.name,
    )
    errors.install(app)
    for router in ROUTERS:
        app.include_router(router)
    app.add_middleware(GZipMiddleware, minimum_size=_GZIP_FROM_BYTES)
    app.add_middleware(BodyLimit)
    app.add_middleware(WorkLimit)
    app.add_middleware(Guard, settings=settings)
    _serve_page(app, static)
    return app


def _serve_page(app: FastAPI, static: Path) -> None:
    """The page at ``/`` and its assets; their names carry a hash, so they may be kept."""

    @app.get("/", include_in_schema=False)
    def index() -> Response:
        page = static / "index.html"
        if not page.is_file():
            return answer(WebError(404, "The page is not built.", "Run `npm run build` in ui/."))
        return FileResponse(page, headers={"Cache-Control": "no-cache"})

    if (static / "assets").is_dir():
        app.mount("/assets", _Assets(directory=static / "assets"), name="assets")


class _Assets(StaticFiles):
    def file_response(self, *args: object, **kwargs: object) -> Response:
        response = super().file_response(*args, **kwargs)  # type: ignore[arg-type]
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable"
        return response
