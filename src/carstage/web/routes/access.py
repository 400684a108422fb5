"""What the handlers reach: the services of the app, and how errors are declared."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from fastapi import Depends
from fastapi.responses import StreamingResponse
from starlette.requests import HTTPConnection

from carstage.web.loading import load
from carstage.web.messages import ErrorMessage
from carstage.web.services import Services

Responses = dict[int | str, dict[str, Any]]

BAD: Responses = {
    400: {"model": ErrorMessage, "description": "The request is wrong."},
    403: {"model": ErrorMessage, "description": "Refused: host, origin or token."},
    413: {"model": ErrorMessage, "description": "The request is too large."},
    422: {"model": ErrorMessage, "description": "Values are wrong; `errors` lists them."},
}
MISSING: Responses = {**BAD, 404: {"model": ErrorMessage, "description": "There is none."}}
BUSY: Responses = {
    **MISSING,
    409: {"model": ErrorMessage, "description": "The state does not allow it now."},
    503: {"model": ErrorMessage, "description": "Something that it needs cannot be had now."},
}
ARCHIVE: Responses = {
    200: {"content": {"application/zip": {}}, "description": "A ZIP archive, made while it goes."},
    **MISSING,
}


def archive(name: str, pieces: Iterator[bytes]) -> StreamingResponse:
    """An archive as a file to save."""
    headers = {
        "Content-Disposition": f'attachment; filename="{name}.zip"',
        "Content-Encoding": "identity",
    }
    return StreamingResponse(pieces, media_type="application/zip", headers=headers)


def _services(connection: HTTPConnection) -> Services:
    load()
    services: Services = connection.app.state.services
    return services


Access = Annotated[Services, Depends(_services)]
