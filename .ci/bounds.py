"""Are the bounds in pyproject.toml true? Record and check a small dataset with such versions.

    python .ci/bounds.py lowest|newest [--python VERSION] [--prepare FOLDER | --prepared FOLDER]

Makes an environment with the lowest version of each direct dependency that the bounds allow, on
Python 3.10, or with the newest of all, on Python 3.12. It records the beginning of the
demonstration by a worker there, validates, reports and exports it, and starts the graphical
interface, which must not report an exception. Then a town and ten frames are compared with those
of the environment that runs this. The pins of `constraint-dependencies` do not count in the new
environment.

`--prepare` only fills a folder with the environment and computes its machine code and a town, which
is most of the work; `--prepared` does the rest with such a folder. `lowest` is a step of `.ci/run`,
prepared beside the tests. `newest` depends on what others have released by the day.
"""

import argparse
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


def call(folder: Path, *command: str | Path) -> None:
    """Run a command in a folder away from the project, whose constraints would hold there.

    Raises:
        CalledProcessError: it failed, after saying why.
    """
    subprocess.run(list(map(str, command)), check=True, cwd=folder)


def prepare(which: str, python: str, folder: Path) -> None:
    """Make the environment in an existing folder, and compute what a first start would."""
    bounds = folder / "bounds.txt"
    text = (ROOT / "pyproject.toml").read_text()
    block = re.search(r"^dependencies = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL)
    if block is None:
        raise SystemExit("pyproject.toml has no list of dependencies")
    bounds.write_text("\n".join(re.findall(r'"(.+?)"', block.group(1))))
    call(folder, "uv", "venv", "--quiet", "--python", interpreter(python), folder / "venv")
    install = ("uv", "pip", "install", "--quiet", "--python", folder / "venv/bin/python")
    resolution = ("--resolution", RESOLUTIONS[which], "--only-binary", ":all:")
    call(folder, *install, *resolution, "-r", bounds)
    call(folder, "uv", "build", "--quiet", "--wheel", "--out-dir", folder / "dist", ROOT)
    call(folder, *install, "--no-deps", *(folder / "dist").glob("*.whl"))
    call(folder, folder / "venv/bin/carstage", "sim", "bake", "Stage01")


def check(which: str, folder: Path) -> None:
    """Record, validate, report, export, serve, and compare, in the environment of a folder."""
    carstage = folder / "venv/bin/carstage"
    # A worker reads the configuration as the run wrote it.
    recording = ("--out", "dataset", "--workers", "1", "--set", f"duration_s={SECONDS}")
    call(folder, carstage, "run", ROOT / "src/carstage/config/demo.yaml", *recording)
    call(folder, carstage, "validate", "dataset")
    call(folder, carstage, "report", "dataset")
    call(folder, carstage, "export", "nuscenes", "dataset", "nuscenes")
    environment = {**os.environ, "PATH": f"{carstage.parent}:{os.environ['PATH']}"}
    gui = [sys.executable, str(ROOT / ".ci" / "gui.py")]
    subprocess.run(gui, check=True, cwd=folder, env=environment)
    same = ["benchmarks", "same-bytes", str(folder / "venv/bin/python"), "--town", "Stage01"]
    subprocess.run([sys.executable, "-m", *same], check=True, cwd=ROOT)
    print(f"the {which} versions record, validate, export, give the same bytes")


def main() -> None:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("which", choices=PYTHONS)
    parser.add_argument("--python", metavar="VERSION")
    folder = parser.add_mutually_exclusive_group()
    folder.add_argument("--prepare", type=Path, metavar="FOLDER")
    folder.add_argument("--prepared", type=Path, metavar="FOLDER")
    given = parser.parse_args()
    python = given.python or PYTHONS[given.which]
    if given.prepare is not None:
        given.prepare.mkdir(parents=True)
        prepare(given.which, python, given.prepare)
    elif given.prepared is not None:
        check(given.which, given.prepared)
    else:
        with tempfile.TemporaryDirectory(prefix=f"{given.which}-") as name:
            prepare(given.which, python, Path(name))
            check(given.which, Path(name))


if __name__ == "__main__":
    main()
