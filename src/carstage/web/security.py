"""Who may speak to the server: Host, Origin and, beyond loopback, a token.

A page of another site cannot use a server on loopback: its requests carry its own Origin (CSRF),
and a name that it has bent to 127.0.0.1 (DNS rebinding) stands in Host.
"""

from __future__ import annotations

import hmac
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from carstage.files.bounded import reading_within
from carstage.web.errors import WebError, answer
from carstage.web.settings import LOOPBACK, WebSettings

_POLICY_VIOLATION = 1008
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; "
    "style-src 'self' 'unsafe-inline'; connect-src 'self'; worker-src 'self' blob:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Guard:
    """Lets through what comes from the server's own page or from no page at all.

    Args:
        app: the application.
        settings: address and token.
    """

    def __init__(self, app: ASGIApp, settings: WebSettings) -> None:
        self._app = app
        self._token = settings.token
        self._folders = settings.folders
        self._cookie = f"carstage_{settings.port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check, then pass on; WebSockets are closed before they are accepted."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        reason = self._refusal(headers)
        if reason is None and self._token is not None and not self._knows(scope, headers):
            if scope["type"] == "http" and scope["path"] == "/" and self._presented(scope):
                await self._welcome()(scope, receive, send)
                return
            reason = "The token is missing or wrong."
        if reason is None:
            with reading_within(self._folders):
                hardened = _hardened(send) if scope["type"] == "http" else send
                await self._app(scope, receive, hardened)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION, "reason": reason})
        else:
            hint = "Open the address that `carstage gui` printed."
            await answer(WebError(403, reason, hint))(scope, receive, send)

    def _refusal(self, headers: Headers) -> str | None:
        hosts = headers.getlist("host")
        if len(hosts) != 1 or _name(hosts[0]) is None:
            return "The request names no host."
        # With a token a bent name is harmless: the cookie is bound to the name it was given under.
        if self._token is None and _name(hosts[0]) not in LOOPBACK:
            return "This host is not served."
        origins = headers.getlist("origin")
        if origins and any(_netloc(origin) != hosts[0].lower() for origin in origins):
            return "Requests from other pages are refused."
        if headers.get("sec-fetch-site") == "cross-site" and headers.get("sec-fetch-mode") not in (
            "navigate",
            None,
        ):
            return "Requests from other pages are refused."
        return None

    def _knows(self, scope: Scope, headers: Headers) -> bool:
        bearer = headers.get("authorization", "")
        given = [bearer.removeprefix("Bearer ")] if bearer.startswith("Bearer ") else []
        for line in headers.getlist("cookie"):
            # Cookies of other programs on this machine come along, of whatever form.
            cookie = cookie_parser(line).get(self._cookie)
            given += [cookie] if cookie is not None else []
        return any(self._equal(token) for token in given)

    def _presented(self, scope: Scope) -> bool:
        query = scope.get("query_string", b"")
        return any(
            self._equal(token) for token in parse_qs(query.decode("latin-1")).get("token", [])
        )

    def _equal(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), (self._token or "").encode())

    def _welcome(self) -> RedirectResponse:
        """The token leaves the address bar and stays as a cookie that scripts cannot read.

        Lax, not strict: the page may be opened from a file. Requests of other pages are refused by
        their Origin.
        """
        response = RedirectResponse("./", status_code=303, headers={"Cache-Control": "no-store"})
        response.set_cookie(
            self._cookie, self._token or "", httponly=True, samesite="lax", path="/"
        )
        return response


def _name(host: str) -> str | None:
    """The name in a Host header, without its port."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


def _netloc(origin: str) -> str | None:
    """Host and port of an Origin; None for one that has none, such as ``null``."""
    try:
        return urlsplit(origin).netloc.lower() or None
    except ValueError:
        return None


def _hardened(send: Send) -> Send:
    async def wrapped(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return wrapped
