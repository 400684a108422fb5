"""Datasets that the command line records, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from carstage.dataset import Dataset, Episode


def record_demo(
    out: Path, seconds: float, python: str = sys.executable, *, size: tuple[int, int] | None = None
) -> Episode:
    """The episode of the demonstration.

    Args:
        out: the dataset's folder.
        seconds: simulated ones.
        python: in whose environment Car-STAGE is installed.
        size: width and height of its pictures (px); None: its own.

    Raises:
        RuntimeError: the command failed; with the end of what it said.
    """
    settings = ["--set", f"duration_s={seconds}"]
    if size is not None:
        settings += ["--set", f"image_size={list(size)}"]
    run_carstage("demo", "--out", str(out), *settings, python=python)
    (episode,) = Dataset(out).episodes
    return episode


def record(config: Mapping[str, Any], folder: Path) -> Path:
    """Record a configuration below an existing folder; the dataset's folder.

    Raises:
        RuntimeError: the command failed; with the end of what it said.
    """
    path, out = folder / "config.yaml", folder / "dataset"
    path.write_text(yaml.safe_dump(dict(config)))
    run_carstage("run", str(path), "--out", str(out))
    return out


def hashes(episode: Episode) -> dict[str, str]:
    """Hash of each committed file by its path."""
    return {entry.path: entry.hash for entry in episode.marker.files}


def run_carstage(
    *arguments: str, python: str = sys.executable, environment: Mapping[str, str] | None = None
) -> str:
    """Run a command of Car-STAGE in a process of its own; what it said.

    Args:
        arguments: its words.
        python: in whose environment Car-STAGE is installed.
        environment: variables beside this process's.

    Raises:
        RuntimeError: the command failed; with the end of what it said.
    """
    done = subprocess.run(
        [python, "-m", "carstage.cli", *arguments],
        env={**os.environ, **(environment or {})},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"carstage {' '.join(arguments)}: {done.stderr[-2000:]}")
    return done.stdout + done.stderr
