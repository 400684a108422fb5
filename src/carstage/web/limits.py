"""How large a request may be, and how many a client may have under way at once."""

from __future__ import annotations

from collections import Counter

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from carstage.web.errors import WebError, answer

MOST_BYTES = 2_000_000
MOST_AT_ONCE = 48
"""A browser has six to a server; this is for eight windows that all load at once."""


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


class WorkLimit:
    """Refuses what a client asks for with 429 while it has ``most_at_once`` requests under way.

    What is refused is not begun, so that one client cannot keep the others from being answered.

    Args:
        app: the application.
        most_at_once: of one address.
    """

    def __init__(self, app: ASGIApp, most_at_once: int = MOST_AT_ONCE) -> None:
        self._app = app
        self._most = most_at_once
        self._under_way: Counter[str] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Count the request while the application has it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        client = (scope.get("client") or ("",))[0]
        if self._under_way[client] >= self._most:
            refusal = WebError(
                429,
                f"{self._most} requests from this address are under way.",
                "Wait until they are answered, then ask again.",
            )
            await answer(refusal)(scope, receive, send)
            return
        self._under_way[client] += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._under_way[client] -= 1
            if not self._under_way[client]:
                del self._under_way[client]
