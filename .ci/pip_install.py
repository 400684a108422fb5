"""Does the wheel work for whoever installs it by plain pip, and is a wrong Python named?

    python .ci/pip_install.py [--json]

Builds the wheel. For Python 3.10, 3.11 and 3.12, as far as they are here: a virtual environment by
`venv`, the wheel by `pip install`, half a second of the demonstration and its validation, outside
the repository and in an empty home. For 3.9 and 3.13: pip must refuse the wheel and name Python,
and so must the command line from a clone. No pins count: pip takes what it finds today, so this is
no part of `.ci/run`.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from bounds import ROOT, found_interpreter

SUPPORTED = ("3.10", "3.11", "3.12")
REFUSED = ("3.9", "3.13")
NAMES_PYTHON = r"'carstage' requires a different Python|Car-STAGE needs Python"


def installed(python: str, wheel: Path, folder: Path) -> str:
    """Install, record, validate; what pip installed of what matters most.

    Raises:
        CalledProcessError: one of them failed.
    """
    environment = {**os.environ, "HOME": str(folder / "home")}
    for name in ("VIRTUAL_ENV", "CARSTAGE_CACHE_DIR", "XDG_CACHE_HOME", "PYTHONPATH"):
        environment.pop(name, None)
    (folder / "home").mkdir(parents=True)

    def call(*command: str | Path) -> str:
        done = subprocess.run(
            list(map(str, command)),
            cwd=folder,
            env=environment,
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        )
        return done.stdout

    call(python, "-m", "venv", folder / "venv")
    pip = (folder / "venv/bin/python", "-m", "pip", "--disable-pip-version-check")
    call(*pip, "install", "--quiet", "--no-cache-dir", wheel)
    carstage = folder / "venv/bin/carstage"
    call(carstage, "demo", "--set", "duration_s=0.5")
    call(carstage, "validate", "datasets/demo")
    listed = dict(line.split("==") for line in call(*pip, "freeze").splitlines() if "==" in line)
    return ", ".join(f"{name} {listed[name]}" for name in ("carla", "numpy", "numba", "pyarrow"))


def refusals(python: str, wheel: Path, folder: Path) -> list[str]:
    """What pip and the command line from a clone say to this Python; each has to name it.

    Raises:
        RuntimeError: one of them accepts it, or does not name Python.
    """
    folder.mkdir()
    subprocess.run([python, "-m", "venv", str(folder / "venv")], check=True)
    inside = str(folder / "venv/bin/python")
    tried = {
        "pip": [inside, "-m", "pip", "--disable-pip-version-check", "install", str(wheel)],
        "clone": [inside, "-m", "carstage.cli", "demo"],
    }
    said = []
    for what, command in tried.items():
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        done = subprocess.run(
            command, capture_output=True, text=True, env=environment, cwd=folder, check=False
        )
        lines = [line for line in done.stderr.splitlines() if re.search(NAMES_PYTHON, line)]
        if done.returncode == 0 or not lines or "Traceback" in done.stderr:
            raise RuntimeError(f"{what} does not refuse {python}: {done.stderr[-500:]}")
        said.append(re.sub(r"\S*/", "", lines[-1]))
    return said


def main(as_json: bool) -> int:
    """Try every Python that is here; 0 where all did what they should."""
    rows: dict[str, dict[str, object]] = {}
    with tempfile.TemporaryDirectory(prefix="pip-install-") as name:
        scratch = Path(name)
        build = ("uv", "build", "--quiet", "--wheel", "--out-dir", scratch / "dist", ROOT)
        subprocess.run(list(map(str, build)), check=True)
        (wheel,) = (scratch / "dist").glob("*.whl")
        for version in (*SUPPORTED, *REFUSED):
            python = found_interpreter(version)
            if python is None:
                rows[version] = {"ok": False, "text": "there is no such Python here"}
                continue
            try:
                if version in SUPPORTED:
                    versions = installed(python, wheel, scratch / version)
                    text = f"demo recorded and valid, with {versions}"
                else:
                    text = " | ".join(refusals(python, wheel, scratch / version))
                rows[version] = {"ok": True, "text": text}
            except (subprocess.CalledProcessError, RuntimeError) as error:
                rows[version] = {"ok": False, "text": str(error)}
            print(f"Python {version}: {rows[version]['text']}", flush=True)
    ok = all(row["ok"] for row in rows.values())
    if as_json:
        print(json.dumps({"bench": "pip-install", "ok": ok, "pythons": rows}))
    return 0 if ok else 1


if __name__ == "__main__":
    sys.exit(main("--json" in sys.argv[1:]))
