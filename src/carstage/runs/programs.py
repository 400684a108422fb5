"""What a run has to know of a scenario's program before it starts: text, map, version of the tool.

Programs are Scenic's, and OpenSCENARIO files that scenario_runner plays.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from carstage.cache import cache_folder
from carstage.config.scene import OpenScenarioScenario, ScenicScenario
from carstage.errors import ConfigError
from carstage.files.bounded import read_bounded
from carstage.files.home import without_tilde
from carstage.plan import ScenarioProgram, Storyboard
from carstage.server.interpreters import AUTO

LARGEST_BYTES = 1 << 20
_SUPPORTED = ("3.0.", "3.1.")
_ASK_S = 60.0
_ASK_SCENIC = "from importlib.metadata import version as v; print(v('scenic'), v('carla'))"
_ASK_RUNNER = "import carla, py_trees, agents.navigation.local_planner; print('ok')"
_MAP = re.compile(r"""^param\s+carla_map\s*=\s*(['"])([\w./-]+)\1\s*(?:#.*)?$""", re.MULTILINE)
_FILE = re.compile(r"""^param\s+map\s*=\s*localPath\(\s*(['"])([^'"]+)\.\w+\1\s*\)""", re.MULTILINE)
_SCENIC_HINT = (
    "Make an environment of its own: `uv venv --no-project scenic-env`, then `uv pip install "
    "--no-config --python scenic-env 'scenic>=3.1,<3.2' carla==0.9.16`, and give "
    "scenic-env/bin/python."
)
_RUNNER_HINT = (
    "Give the Python that scenario_runner runs with, and put CARLA's PythonAPI/carla on PYTHONPATH."
)


def read_program(
    scenario: ScenicScenario | OpenScenarioScenario, folder: Path | None = None
) -> ScenarioProgram | Storyboard:
    """The program that a scenario names; of OpenSCENARIO without scenario_runner what it says.

    Args:
        scenario: of the configuration.
        folder: what a relative path is relative to; None: the working directory.

    Raises:
        ConfigError: it cannot be read, names no map, or the interpreter lacks what plays it; with
            the path of the setting.
    """
    from carstage.open_scenario import read_storyboard, town_of  # few runs play such a file

    path = (folder or Path()) / without_tilde(scenario.file)
    try:
        content = read_bounded(path, LARGEST_BYTES)
    except OSError as error:
        message = f"scenario.file: {path} cannot be read: {error.strerror}."
        raise ConfigError(message, "Name a file.") from error
    digest = f"sha256:{hashlib.sha256(content).hexdigest()}"  # which the collector can make, too
    if isinstance(scenario, OpenScenarioScenario):
        if scenario.scenario_runner is None:
            file_town, storyboard = read_storyboard(content, scenario.params)
            return Storyboard(storyboard, file_town)
        file_town = town_of(content, scenario.params)
        root = _runner_folder(scenario.scenario_runner)
        _answer(scenario.python, _ASK_RUNNER, _RUNNER_HINT)
        return ScenarioProgram(digest, _hash_of_modules(root), file_town, "scenario.file")
    town = scenario.map or _named_map(content.decode("utf-8", errors="replace"))
    if town is None:
        raise ConfigError(
            f"scenario.map: {path} names no map in words.",
            "Give one here: a name, such as Stage01.",
        )
    version = _answer(scenario.python, _ASK_SCENIC, _SCENIC_HINT).split()[0]
    if not version.startswith(_SUPPORTED):
        raise ConfigError(f"scenario.python: Scenic {version} is not known here.", _SCENIC_HINT)
    return ScenarioProgram(digest, version, town, "scenario.map")


def program_plan(scenario: ScenicScenario | OpenScenarioScenario) -> dict[str, Any]:
    """``program`` of the collector's plan."""
    plan = {
        "file": str(without_tilde(scenario.file).absolute()),
        "python": _interpreter(scenario.python),
        "maps": str(cache_folder() / "scenic"),
    }
    if isinstance(scenario, OpenScenarioScenario) and scenario.scenario_runner is not None:
        plan["scenario_runner"] = str(without_tilde(scenario.scenario_runner).absolute())
    return plan


def _named_map(text: str) -> str | None:
    """The map by ``param carla_map``, else by the file of ``param map``."""
    named = _MAP.search(text)
    if named is not None:
        return named[2]
    file = _FILE.search(text)
    return None if file is None else file[2].rsplit("/", 1)[-1]


def _runner_folder(given: str) -> Path:
    folder = without_tilde(given)
    if not (folder / "scenario_runner.py").is_file() or not (folder / "srunner").is_dir():
        raise ConfigError(
            f"scenario.scenario_runner: {folder} does not hold scenario_runner.py and srunner.",
            "Give the folder of CARLA's scenario_runner.",
        )
    return folder


def _hash_of_modules(folder: Path) -> str:
    """A named hash over the Python files of scenario_runner."""
    digest = hashlib.sha256()
    for path in [folder / "scenario_runner.py", *sorted((folder / "srunner").rglob("*.py"))]:
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0")
        digest.update(read_bounded(path, LARGEST_BYTES) + b"\0")
    return f"sha256:{digest.hexdigest()}"


def _interpreter(wanted: str) -> str:
    return sys.executable if wanted == AUTO else str(without_tilde(wanted).absolute())


def _answer(wanted: str, question: str, hint: str) -> str:
    """What an interpreter prints when asked for what a program needs.

    Raises:
        ConfigError: it lacks something.
    """
    python = _interpreter(wanted)
    try:
        ended = subprocess.run(
            [python, "-c", question], capture_output=True, text=True, timeout=_ASK_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ConfigError(f"scenario.python: {python} cannot be run: {error}.", hint) from error
    if ended.returncode != 0:
        last = (ended.stderr.strip().splitlines() or ["it failed"])[-1]
        raise ConfigError(f"scenario.python: {python} lacks what is needed: {last}.", hint)
    return ended.stdout
