"""How large a request may be: no body is read further than that."""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from carstage.web.errors import WebError, answer

MOST_BYTES = 2_000_000


class BodyLimit:
    """Refuses bodies beyond ``most_bytes`` with 413, announced or not.

    Args:
        app: the application.
        most_bytes: of a request's body.
    """

    def __init__(self, app: ASGIApp, most_bytes: int = MOST_BYTES) -> None:
        self._app = app
        self._most_bytes = most_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Read the body, then let the application have it."""
        if scope["type"] != "http" or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self._app(scope, receive, send)
            return
        body = bytearray()
        more = True
        while more:
            message = await receive()
            if message["type"] != "http.request":
                return  # the client has gone
            body += message.get("body", b"")
            more = message.get("more_body", False)
            if len(body) > self._most_bytes:
                refusal = WebError(
                    413,
                    f"The request is larger than {self._most_bytes} bytes.",
                    "Configurations are small: is this the right file?",
                )
                await answer(refusal)(scope, receive, send)
                return
        given = False

        async def replay() -> Message:
            nonlocal given
            if given:
                return await receive()
            given = True
            return {"type": "http.request", "body": bytes(body), "more_body": False}

        await self._app(scope, replay, send)
