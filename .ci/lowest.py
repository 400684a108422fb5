"""Are the lower bounds in pyproject.toml true? Record and check a small dataset with them.

    python .ci/lowest.py [PYTHON]

Makes an environment (default: Python 3.10, the lowest that is supported) with the lowest version
of each direct dependency that the bounds allow. It records the beginning of the demonstration
there, validates, reports and exports it, and starts the graphical interface. Then a town and ten
frames are compared with those of the environment that runs this. The pins of
`constraint-dependencies` do not count in the new environment.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LOWEST_PYTHON = "3.10"
SECONDS = 0.5
"""Of the demonstration: five frames of eight sensors."""


def interpreter(version: str) -> str:
    """A Python of that version on PATH or among pyenv's; else the one that runs this."""
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    named = [shutil.which(f"python{version}"), *sorted(versions.glob(f"{version}.*/bin/python"))]
    for candidate in filter(None, named):
        # A shim of pyenv is on PATH even where its version is not selected: only running it tells.
        probe = subprocess.run([candidate, "-V"], capture_output=True, text=True, check=False)
        if probe.returncode == 0 and probe.stdout.startswith(f"Python {version}."):
            return str(candidate)
    print(f"no Python {version} here: tried with {sys.version.split()[0]}", flush=True)
    return sys.executable


def main(python: str) -> None:
    """Install, record, validate, export, serve.

    Raises:
        CalledProcessError: one of them failed, after saying why.
    """
    with tempfile.TemporaryDirectory(prefix="lowest-") as name:
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
        call(*install, "--resolution", "lowest-direct", "--only-binary", ":all:", "-r", bounds)
        call("uv", "build", "--quiet", "--wheel", "--out-dir", scratch / "dist", ROOT)
        call(*install, "--no-deps", *(scratch / "dist").glob("*.whl"))
        carstage = scratch / "venv/bin/carstage"
        call(carstage, "demo", "--out", "dataset", "--set", f"duration_s={SECONDS}")
        call(carstage, "validate", "dataset")
        call(carstage, "report", "dataset")
        call(carstage, "export", "nuscenes", "dataset", "nuscenes")
        environment = {**os.environ, "PATH": f"{carstage.parent}:{os.environ['PATH']}"}
        gui = [sys.executable, str(ROOT / ".ci" / "gui.py")]
        subprocess.run(gui, check=True, cwd=scratch, env=environment)
        same = ["benchmarks", "same-bytes", str(scratch / "venv/bin/python"), "--town", "Stage01"]
        subprocess.run([sys.executable, "-m", *same], check=True, cwd=ROOT)
    print(f"Python {python}: the lowest versions record, validate, export and give the same bytes")


if __name__ == "__main__":
    main(*(sys.argv[1:] or [LOWEST_PYTHON]))
