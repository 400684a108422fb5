"""Install the client wheels of every supported CARLA version, each into a venv of its own.

`python .ci/wheels.py` makes `CACHE/wheels/VERSION` where an interpreter is found that the wheel
exists for (on PATH, below pyenv's versions, or from uv), and prints one line per version: what is
there or why not. It always ends with 0: tests skip with that reason where a wheel is missing.
CACHE is the user's cache folder for Car-STAGE, or what CARSTAGE_CACHE_DIR names.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import rmtree, which

from carstage_sim.cache import cache_folder

# Interpreters that each wheel exists for, preferred first.
INTERPRETERS = {
    "0.9.13": ("3.8",),
    "0.9.14": ("3.8",),
    "0.9.15": ("3.10", "3.8"),
    "0.9.16": ("3.11", "3.10", "3.12"),
}
_RUN_TIMEOUT_S = 20.0
_INSTALL_TIMEOUT_S = 600.0


def main() -> int:
    for version, pythons in INTERPRETERS.items():
        print(f"carla {version}: {_install(version, pythons)}", flush=True)
    return 0


def _install(version: str, pythons: tuple[str, ...]) -> str:
    folder = cache_folder() / "wheels" / version
    installed = folder / "bin" / "python"
    if _works(installed, version):
        return f"ready in {folder} ({_version(installed)})"
    interpreter = next(_interpreters(pythons), None)
    if interpreter is None:
        return f"not tested here: no Python {' or '.join(pythons)} on PATH, in pyenv or in uv"
    rmtree(folder, ignore_errors=True)
    try:
        _run(str(interpreter), "-m", "venv", str(folder), timeout_s=_INSTALL_TIMEOUT_S)
        _run(
            *(str(installed), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"),
            *("--no-deps", "--only-binary", ":all:", f"carla=={version}"),
            timeout_s=_INSTALL_TIMEOUT_S,
        )
    except (OSError, subprocess.SubprocessError) as error:
        rmtree(folder, ignore_errors=True)
        return f"not tested here: {_reason(error)}"
    if not _works(installed, version):
        return f"not tested here: the wheel in {folder} cannot be imported"
    return f"installed into {folder} ({_version(installed)})"


def _interpreters(pythons: tuple[str, ...]) -> Iterator[Path]:
    """Interpreters of these versions that run, best version first."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for python in pythons:
        candidates = [*sorted(pyenv.glob(f"{python}.*/bin/python")), which(f"python{python}")]
        candidates.append(_found_by_uv(python))
        for candidate in filter(None, candidates):
            # A pyenv shim is on PATH even where its version is not selected: only running tells.
            if _version(Path(candidate)) == python:
                yield Path(candidate)


def _found_by_uv(python: str) -> str | None:
    uv = which("uv")
    if uv is None:
        return None
    try:
        return _run(uv, "python", "find", "--no-project", "--managed-python", python).strip()
    except (OSError, subprocess.SubprocessError):
        return None


def _version(interpreter: Path) -> str:
    """Major and minor version of an interpreter, empty where it does not run."""
    try:
        return _run(
            str(interpreter), "-c", "import sys; print('%d.%d' % sys.version_info[:2])"
        ).strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def _works(interpreter: Path, version: str) -> bool:
    try:
        code = "import carla; from importlib.metadata import version; print(version('carla'))"
        return _run(str(interpreter), "-c", code).strip() == version
    except (OSError, subprocess.SubprocessError):
        return False


def _run(*command: str, timeout_s: float = _RUN_TIMEOUT_S) -> str:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        command, check=True, capture_output=True, text=True, timeout=timeout_s, env=environment
    ).stdout


def _reason(error: Exception) -> str:
    lines = (getattr(error, "stderr", None) or str(error)).strip().splitlines()
    return lines[-1] if lines else type(error).__name__


if __name__ == "__main__":
    sys.exit(main())
