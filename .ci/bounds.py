"""Are the bounds in pyproject.toml true? Record and check a small dataset with such versions.

    python .ci/bounds.py lowest|newest [PYTHON]

Makes an environment with the lowest version of each direct dependency that the bounds allow, on
Python 3.10, or with the newest of all, on Python 3.12. It records the beginning of the
demonstration by a worker there, validates, reports and exports it, and starts the graphical
interface, which must not report an exception. Then a town and ten frames are compared with those
of the environment that runs this. The pins of `constraint-dependencies` do not count in the new
environment.

`lowest` is a step of `.ci/run`. `newest` depends on what others have released by the day.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PYTHONS = {"lowest": "3.10", "newest": "3.12"}
RESOLUTIONS = {"lowest": "lowest-direct", "newest": "highest"}
SECONDS = 0.5
"""Of the demonstration: five frames of eight sensors."""


def interpreter(version: str) -> str:
    """A Python of that version, else the one that runs this."""
    found = found_interpreter(version)
    if found is None:
        print(f"no Python {version} here: tried with {sys.version.split()[0]}", flush=True)
    return found or sys.executable


def found_interpreter(version: str) -> str | None:
    """A Python of that version on PATH or among pyenv's."""
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    named = [shutil.which(f"python{version}"), *sorted(versions.glob(f"{version}.*/bin/python"))]
    for candidate in filter(None, named):
        # A shim of pyenv is on PATH even where its version is not selected: only running it tells.
        probe = subprocess.run([candidate, "-V"], capture_output=True, text=True, check=False)
        if probe.returncode == 0 and probe.stdout.startswith(f"Python {version}."):
            return str(candidate)
    return None


def main(which: str, python: str) -> None:
    """Install, record, validate, export, serve.

    Raises:
        CalledProcessError: one of them failed, after saying why.
    """
    with tempfile.TemporaryDirectory(prefix=f"{which}-") as name:
        scratch = Path(name)

        def call(*command: str | Path) -> None:
            # Away from the project: its constraints would hold there.
            subprocess.run(list(map(str, command)), check=True, cwd=scratch)

        bounds = scratch / "bounds.txt"
        text = (ROOT / "pyproject.toml").read_text()
        block = re.search(r"^dependencies = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL)
        if block is None:
            raise SystemExit("pyproject.toml has no list of dependencies")
        bounds.write_text("\n".join(re.findall(r'"(.+?)"', block.group(1))))
        call("uv", "venv", "--quiet", "--python", interpreter(python), scratch / "venv")
        install = ("uv", "pip", "install", "--quiet", "--python", scratch / "venv/bin/python")
        resolution = ("--resolution", RESOLUTIONS[which], "--only-binary", ":all:")
        call(*install, *resolution, "-r", bounds)
        call("uv", "build", "--quiet", "--wheel", "--out-dir", scratch / "dist", ROOT)
        call(*install, "--no-deps", *(scratch / "dist").glob("*.whl"))
        carstage = scratch / "venv/bin/carstage"
        # A worker reads the configuration as the run wrote it.
        recording = ("--out", "dataset", "--workers", "1", "--set", f"duration_s={SECONDS}")
        call(carstage, "run", ROOT / "src/carstage/config/demo.yaml", *recording)
        call(carstage, "validate", "dataset")
        call(carstage, "report", "dataset")
        call(carstage, "export", "nuscenes", "dataset", "nuscenes")
        environment = {**os.environ, "PATH": f"{carstage.parent}:{os.environ['PATH']}"}
        gui = [sys.executable, str(ROOT / ".ci" / "gui.py")]
        subprocess.run(gui, check=True, cwd=scratch, env=environment)
        same = ["benchmarks", "same-bytes", str(scratch / "venv/bin/python"), "--town", "Stage01"]
        subprocess.run([sys.executable, "-m", *same], check=True, cwd=ROOT)
    print(f"Python {python}: the {which} versions record, validate, export, give the same bytes")


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3 or sys.argv[1] not in PYTHONS:
        raise SystemExit(__doc__)
    main(sys.argv[1], sys.argv[2] if len(sys.argv) == 3 else PYTHONS[sys.argv[1]])
