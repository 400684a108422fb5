"""Every failure as one shape of JSON, without tracebacks, paths of this machine or secrets."""

from __future__ import annotations

import logging
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from carstage.errors import BadInputError, CarStageError, ConfigError
from carstage.web.messages import ErrorMessage, FieldProblem
from carstage.web.wording import page_words, problem_in_page_words

_log = logging.getLogger("carstage.web")

_CODES = {400: "bad_request", 403: "refused", 404: "not_found", 405: "method", 409: "conflict",
          413: "too_large", 415: "media_type", 422: "bad_input", 429: "too_many",
          503: "unavailable"}  # fmt: skip


class WebError(CarStageError):
    """A request that cannot be answered.

    Args:
        status: HTTP status.
        code: a word for programs.
        message: what happened.
        hint: what to do.
        errors: by field.
    """

    def __init__(
        self,
        status: int,
        message: str,
        hint: str = "",
        *,
        code: str | None = None,
        errors: list[FieldProblem] | None = None,
    ) -> None:
        super().__init__(message, hint)
        self.status = status
        self.code = code or _CODES.get(status, "error")
        self.errors = errors or []


def not_found(what: str) -> WebError:
    """There is no such thing."""
    return WebError(404, f"There is no {what}.", "It may have been removed: load the list anew.")


def answer(error: WebError) -> JSONResponse:
    """The response for an error."""
    message = ErrorMessage(
        code=error.code,
        message=page_words(error.message),
        hint=page_words(error.hint, hint=True),
        errors=[problem_in_page_words(problem) for problem in error.errors],
    )
    return JSONResponse(message.model_dump(mode="json"), status_code=error.status)


def install(app: FastAPI) -> None:
    """Make every error of an app an ``ErrorMessage``."""
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(CarStageError, _ours)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(OSError, _system)
    app.add_exception_handler(Exception, _bug)


async def _invalid(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    problems = [
        FieldProblem(path=_path(details.get("loc", ())), message=str(details.get("msg", "wrong")))
        for details in error.errors()[:100]
    ]
    return answer(WebError(422, "Something in the request cannot be used.", errors=problems))


def _path(location: tuple[Any, ...]) -> list[str | int]:
    parts = [part if isinstance(part, int) else str(part) for part in location]
    return parts[1:] if parts[:1] in (["body"], ["query"], ["path"]) else parts


async def _ours(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, CarStageError)
    if isinstance(error, WebError):
        return answer(error)
    if isinstance(error, ConfigError):
        from carstage.web.configure.problems import problems_of

        return answer(
            WebError(422, error.message, error.hint, code="config", errors=problems_of(error))
        )
    status = 400 if isinstance(error, BadInputError) else 409
    return answer(WebError(status, error.message, error.hint, code="failed"))


async def _http(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    response = answer(WebError(error.status_code, f"{error.detail}."))
    response.headers.update(error.headers or {})
    return response


async def _system(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, OSError)
    _log.warning("a request failed: %s", error)
    return answer(
        WebError(
            503,
            f"The file system refused: {error.strerror or 'unknown'}.",
            "Check free space and permissions of the datasets' folder.",
        )
    )


async def _bug(_request: Request, error: Exception) -> JSONResponse:
    return answer(
        WebError(
            500,
            f"This is a bug in Car-STAGE ({type(error).__name__}).",
            "The terminal of the interface shows the details; please report them.",
            code="bug",  # which the server logs with its traceback
        )
    )
