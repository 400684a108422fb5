"""The Ray executor: its suite runs in a network namespace, as Ray listens on all interfaces."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.loopback_only import ALONE
from carstage.errors import BadInputError
from carstage.execution import ray_slots
from carstage.execution.ray_slots import RayExecutor, parse_resources

ROOT = Path(__file__).parents[3]
SUITE = "tests/carstage/execution/ray_cluster_suite.py"


def why_not() -> str:
    """Why the suite cannot run here; empty where it can."""
    if find_spec("ray") is None:
        return "Ray is not installed: pip install 'carstage[ray]'"
    tried = subprocess.run([*ALONE, "true"], capture_output=True, text=True)
    if tried.returncode:
        return "a network namespace needs root: " + tried.stderr.strip().splitlines()[-1]
    return ""


@pytest.mark.timeout(900)
def test_the_ray_executor_keeps_the_rules_on_two_nodes(tmp_path: Path) -> None:
    reason = why_not()
    if reason:
        pytest.skip(reason)
    options = ["-q", "-n", "0", "-p", "no:cacheprovider", "--basetemp", str(tmp_path / "suite")]
    ended = subprocess.run(
        [*ALONE, sys.executable, "-m", "pytest", *options, "--timeout", "300", SUITE],
        cwd=ROOT,
        env={**os.environ, **dict.fromkeys(ray_slots.OFF, "0"), "RAY_TMPDIR": "/tmp"},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stdout[-8000:] + ended.stderr[-2000:]


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ModuleNotFoundError(f"No module named {name!r}")

    monkeypatch.setattr(ray_slots.importlib, "import_module", missing)
    with pytest.raises(BadInputError, match=r"pip install 'carstage\[ray\]'"):
        RayExecutor(1)


def test_resources_are_read_with_a_core_where_none_is_named() -> None:
    assert parse_resources("{}") == {"CPU": 1.0}
    assert parse_resources('{"GPU": 0.5, "simulator": 1}') == {
        "CPU": 1.0,
        "GPU": 0.5,
        "simulator": 1.0,
    }


@pytest.mark.parametrize(
    "text",
    ["", "CPU=2", "[1]", '{"CPU": "2"}', '{"CPU": -1}', '{"a": true}', '{"CPU": 1e999}',
     '{"CPU": NaN}', f'{{"CPU": {"9" * 400}}}'],
)  # fmt: skip
def test_resources_that_are_no_amounts_are_refused(text: str) -> None:
    with pytest.raises(BadInputError, match="does not name amounts"):
        parse_resources(text)


@pytest.mark.parametrize(
    ("resources", "why"),
    [
        ({"GPU": 1.5}, "GPU cannot be 1.5: above 1 it has to be a whole number"),
        ({"simulator": 0.00001}, "simulator cannot be 1e-05: 0.0001 is the least"),
        ({"object_store_memory": 5.0}, "Ray gives it to nobody"),
    ],
)
def test_resources_that_ray_gives_to_nobody_are_refused(
    resources: dict[str, float], why: str
) -> None:
    with pytest.raises(BadInputError, match=why):
        RayExecutor(1, resources=resources)


def test_no_worker_is_not_a_number_of_workers() -> None:
    with pytest.raises(BadInputError, match="0 is not a number of workers"):
        RayExecutor(0)
