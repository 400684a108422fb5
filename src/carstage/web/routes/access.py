"""What the handlers reach: the services of the app, and how errors are declared."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Depends
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


def _services(connection: HTTPConnection) -> Services:
    load()
    services: Services = connection.app.state.services
    return services


Access = Annotated[Services, Depends(_services)]
