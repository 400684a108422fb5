"""A proxy before an object store that spoils answers, as a network and a store in trouble do."""

from __future__ import annotations

import http.client
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

_LATE_S = 1.0


@dataclass(frozen=True, slots=True)
class Spoilt:
    """What becomes of a request.

    Attributes:
        how: ``answered`` by ``status`` and the error ``code`` in its place; ``cut off`` before it
            is passed on; ``no answer``, though it was done; ``late``, by a second; ``held`` until
            the proxy ends.
        status: of the answer, where it is answered here.
        code: S3's word for the error; empty: the answer has no body.
    """

    how: str
    status: int = 0
    code: str = ""

    def __str__(self) -> str:
        return str(self.code or self.status or self.how)


Spoil = Callable[[str, str], "Spoilt | None"]
"""Says of a request, by its method and path, what becomes of it; None: it is passed on."""


class SpoilingProxy:
    """Stands before an S3 server and spoils what it is told to.

    Args:
        port: of the server.
        spoil: asked for each request; may be set to another one at any time.
    """

    def __init__(self, port: int, spoil: Spoil) -> None:
        self.spoil = spoil
        self.spoilt: Counter[str] = Counter()
        """How many requests met with what; ``not at all`` are those that were passed on."""
        self._ended = threading.Event()
        lock = threading.Lock()
        proxy = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            disable_nagle_algorithm = True

            def _pass_on(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                with lock:
                    spoilt = proxy.spoil(self.command, self.path)
                    proxy.spoilt[str(spoilt or "not at all")] += 1
                how = spoilt.how if spoilt else ""
                if how == "held":
                    proxy._ended.wait()
                if how in ("held", "cut off"):
                    self.close_connection = True
                    return
                if spoilt and how == "answered":
                    self._answer(spoilt.status, {}, _error(spoilt.code))
                    return
                if how == "late":
                    proxy._ended.wait(_LATE_S)
                status, headers, content = self._ask(body)
                if how == "no answer":  # it was done all the same
                    self.close_connection = True
                    return
                self._answer(status, headers, content)

            def _ask(self, body: bytes) -> tuple[int, Mapping[str, str], bytes]:
                upstream = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
                try:
                    headers = {k: v for k, v in self.headers.items() if k.lower() != "host"}
                    headers["Host"] = self.headers["Host"]
                    upstream.request(self.command, self.path, body, headers)
                    answer = upstream.getresponse()
                    return answer.status, dict(answer.getheaders()), answer.read()
                finally:
                    upstream.close()

            def _answer(self, status: int, headers: Mapping[str, str], content: bytes) -> None:
                self.send_response_only(status)
                length = str(len(content))
                for name, value in headers.items():
                    if name.lower() == "content-length":
                        length = value if self.command == "HEAD" else length
                    elif name.lower() not in ("transfer-encoding", "connection"):
                        self.send_header(name, value)
                self.send_header("Content-Length", length)
                self.end_headers()
                if self.command != "HEAD":
                    self.wfile.write(content)

            do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = _pass_on  # noqa: N815

            def log_message(self, format: str, *args: object) -> None:
                """Say nothing."""

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, request: Any, client_address: Any) -> None:
                """Killed clients leave connections that break: what this is about."""

        self._server = Server(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}"

    @contextmanager
    def serving(self) -> Iterator[SpoilingProxy]:
        """A stretch in which it answers."""
        thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        thread.start()
        try:
            yield self
        finally:
            self._ended.set()
            self._server.shutdown()
            self._server.server_close()
            thread.join()


def _error(code: str) -> bytes:
    """The body of S3's answers that say no."""
    if not code:
        return b""
    head = '<?xml version="1.0" encoding="UTF-8"?>'
    return f"{head}<Error><Code>{code}</Code><Message>{code}</Message></Error>".encode()
