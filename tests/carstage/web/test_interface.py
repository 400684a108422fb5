"""The interface as a whole: what it promises, what it loads, what strange requests do to it."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import schemathesis
from schemathesis import GenerationMode

from carstage.web.openapi import openapi_document
from carstage.web.preview.sensor_preview import SensorPreviewService
from sites import Site, open_site

pytestmark = pytest.mark.xdist_group("web")
EXAMPLES = int(os.environ.get("CARSTAGE_INTERFACE_EXAMPLES", "4"))
"""Requests of each kind to each operation; more of them take a quarter of a second each."""
TOKEN = "a-token-that-nobody-guesses"
STRANGERS = (
    {"Authorization": ""},
    {"Authorization": "Bearer wrong"},
    {"Authorization": "", "Cookie": "carstage_8321=wrong"},
    {"Origin": "http://evil.example"},
)
"""Headers instead of those with the token, or beside them."""

document = openapi_document()
schema = schemathesis.openapi.from_dict(document)


def attempts() -> list[Any]:
    """Each operation with valid requests, and those that take values with wrong ones, too."""
    tried = [result.ok() for result in schema.get_all_operations()]
    takes = [o for o in tried if list(o.iter_parameters()) or o.body]
    return [(o, GenerationMode.POSITIVE) for o in tried] + [
        (o, GenerationMode.NEGATIVE) for o in takes
    ]


@pytest.fixture(scope="module")
def disturbed(site: Site, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A site of its own whose runs and jobs end at once, and whose simulator never is ready.

    Requests are checked, planned, queued and written down as ever; only the process that comes out
    of it is another, and no object store is asked.
    """
    root = tmp_path_factory.mktemp("disturbed")
    shutil.copytree(site.root / site.dataset, root / site.dataset)

    def start(_config: Path, _out: Path, _run_id: str, log: Path, **_: Any) -> Any:
        with log.open("ab") as output:
            return subprocess.Popen(["true"], stdout=output, stderr=output)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("carstage.runs.launching.launch", start)
        patch.setattr("carstage.web.datasets.jobs.WORKER", ("true",))
        patch.setattr(SensorPreviewService, "warm", lambda *_: False)
        patch.setattr("carstage.storage.objects.ObjectStore.check", lambda _: None)
        patch.setattr("carstage.web.roots.Roots.add", lambda *_: None)
        with open_site(root, token=TOKEN) as client:
            client.headers["Authorization"] = f"Bearer {TOKEN}"
            yield Site(client, root, site.dataset, site.episode)


@pytest.mark.parametrize(
    ("operation", "mode"), attempts(), ids=lambda v: getattr(v, "label", getattr(v, "value", v))
)
def test_no_request_makes_the_server_fail(
    disturbed: Site, site: Site, operation: Any, mode: GenerationMode
) -> None:
    there = {"dataset": disturbed.dataset, "episode": disturbed.episode}

    def send(case: Any) -> None:
        arguments = case.as_transport_kwargs(base_url="http://127.0.0.1:8321")
        sent = {key: arguments[key] for key in ("params", "json", "headers") if key in arguments}
        if isinstance(arguments.get("data"), bytes | str):
            sent["content"] = arguments["data"]
        method, url = arguments["method"], arguments["url"]
        if not (disturbed.root / disturbed.dataset).exists():  # a request has removed it
            shutil.copytree(site.root / site.dataset, disturbed.root / disturbed.dataset)
        answer = disturbed.client.request(method, url, **sent)
        assert answer.status_code < 500, answer.text
        assert answer.status_code != 403, answer.text
        assert "Traceback" not in answer.text
        for headers in STRANGERS:
            sent["headers"] = {**arguments.get("headers", {}), **headers}
            refused = disturbed.client.request(method, url, **sent)
            assert refused.status_code == 403, (headers, refused.text)
            assert TOKEN not in refused.text

    @hypothesis.given(case=operation.as_strategy(generation_mode=mode))
    @hypothesis.settings(
        max_examples=EXAMPLES,
        database=None,
        deadline=None,
        derandomize=True,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    def check(case: Any) -> None:
        send(case)
        if "dataset" in case.path_parameters:  # once more for what is there
            names = case.path_parameters.keys() & there.keys()
            case.path_parameters.update({name: there[name] for name in names})
            send(case)

    check()


def test_every_route_is_described_and_so_are_its_errors() -> None:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            assert operation["description"], f"{method} {path}"
            assert operation["operationId"]
    schemas = document["components"]["schemas"]
    assert {"LiveMessage", "ClientMessage", "SnapshotMessage", "ErrorMessage"} <= set(schemas)


def test_starting_the_server_loads_nothing_heavy() -> None:
    heavy = ["numpy", "pyarrow", "PIL", "numba", "carla", "yaml"]
    program = f"import carstage.web.app, sys; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
