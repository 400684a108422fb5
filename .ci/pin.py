"""Resolve every extra anew and write the exact versions into pyproject.toml.

    python .ci/pin.py            upgrade all, write
    python .ci/pin.py --check    exit 1 when what is installed differs from what is pinned

The pins stand as `[tool.uv] constraint-dependencies`: a lock file would carry download addresses.
"""

import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

PYPROJECT = Path(__file__).resolve().parent.parent / "pyproject.toml"
PLATFORM = re.compile(
    r"( and )?platform_machine == 'x86_64' and platform_python_implementation == 'CPython'"
    r" and sys_platform == 'linux'"
)
BLOCK = re.compile(r"constraint-dependencies = \[.*?\]", re.DOTALL)


def resolve() -> list[str]:
    """All packages of all extras as `name==version ; marker`."""
    text = PYPROJECT.read_text()
    PYPROJECT.write_text(BLOCK.sub("constraint-dependencies = []", text))
    try:
        subprocess.run(["uv", "lock", "--upgrade", "--quiet"], check=True)
        command = ["uv", "export", "--all-extras", "--no-hashes", "--no-emit-project", "--quiet"]
        exported = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    finally:
        PYPROJECT.write_text(text)
    lines = (line.split("#")[0].strip() for line in exported.splitlines())
    return sorted(PLATFORM.sub("", line).strip(" ;") for line in lines if "==" in line)


def write(pins: list[str]) -> None:
    rows = "".join(f'  "{pin}",\n' for pin in pins)
    text = BLOCK.sub(lambda _: f"constraint-dependencies = [\n{rows}]", PYPROJECT.read_text())
    PYPROJECT.write_text(text)
    subprocess.run(["uv", "lock", "--quiet"], check=True)


def check() -> int:
    """Compare this interpreter's packages with the pins."""
    block = BLOCK.search(PYPROJECT.read_text())
    pins = re.findall(r'"([^"]+)"', block.group()) if block else []
    allowed: dict[str, set[str]] = {}
    for pin in pins:
        name, version = pin.split(";")[0].strip().split("==")
        allowed.setdefault(name.lower(), set()).add(version.strip())
    wrong = []
    for package in metadata.distributions():
        name = re.sub(r"[-_.]+", "-", package.name).lower()
        if name in {"carstage", "pip", "setuptools", "wheel"}:
            continue
        if package.version not in allowed.get(name, set()):
            wrong.append(f"{name} {package.version}: pinned {sorted(allowed.get(name, set()))}")
    for line in wrong:
        print(line, file=sys.stderr)
    print(f"{len(wrong)} of the installed packages differ from the pins")
    return 1 if wrong else 0


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        sys.exit(check())
    write(resolve())
