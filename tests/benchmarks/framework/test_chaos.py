"""The campaign of chaos in short: eight episodes, two commands, a store that fails."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.mark.end_to_end
@pytest.mark.timeout(900)
@pytest.mark.xdist_group("runs")
def test_eight_episodes_are_there_once_whatever_breaks() -> None:
    """In a process of its own, as it leaves the network."""
    options = ["--episodes", "8", "--workers", "2", "--seed", "8", "--every-s", "2", "--json"]
    ended = subprocess.run(
        [sys.executable, "-m", "benchmarks", "chaos", *options],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr[-2000:]
    verdict = json.loads(ended.stdout.splitlines()[-1])
    figures = {name: figure["value"] for name, figure in verdict["figures"].items()}
    assert figures["committed_episodes"] == 8
    without_ray = [note for note in verdict["notes"] if note.startswith("without Ray")]
    assert figures["ray_nodes_removed"] == (0 if without_ray else 1)
    if without_ray:
        pytest.skip(f"all but Ray: {without_ray[0]}")
