"""The wheel holds what the commands of ``carstage bench`` need, and no other benchmark."""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from carstage.bench.comparison.programs import PROGRAMS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[3]
SRC = ROOT / "src"
BENCH = "carstage.bench"


def installed(package: str) -> dict[str, Path]:
    """Modules below a package, by name."""
    found = {}
    for path in (SRC / package.replace(".", "/")).rglob("*.py"):
        parts = path.relative_to(SRC).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported_by(path: Path) -> Iterator[str]:
    """Dotted names that a module imports, in functions too."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_the_wheel_holds_the_two_packages_and_nothing_else() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["build"]
    assert build["targets"]["wheel"] == {"packages": ["src/carstage", "src/carstage_sim"]}
    assert set(build) == {"targets"}
    assert not {*installed("carstage"), *installed("carstage_sim")} & {
        "carstage.benchmarks",
        "carstage_sim.check",
    }


def test_no_installed_module_imports_a_benchmark() -> None:
    for package in ("carstage", "carstage_sim"):
        for module, path in installed(package).items():
            names = {name.split(".")[0] for name in imported_by(path)}
            assert "benchmarks" not in names, module


def test_every_module_of_bench_is_needed_by_a_command() -> None:
    modules = installed(BENCH)
    needed = {f"{BENCH}.clients.{p.module}" for p in PROGRAMS.values() if p.module is not None}
    for path in installed("carstage.cli").values():
        needed |= {name for name in imported_by(path) if name in modules}
    new = set(needed)
    while new:
        found = {name for module in new for name in imported_by(modules[module]) if name in modules}
        packages = {module.rpartition(".")[0] for module in new} & modules.keys()
        new = (found | packages) - needed
        needed |= new
    assert needed == modules.keys()


def test_every_public_name_of_bench_is_used_by_what_is_installed() -> None:
    used: Counter[str] = Counter()
    for path in installed("carstage").values():
        reader = io.StringIO(path.read_text("utf-8")).readline
        used.update(t.string for t in tokenize.generate_tokens(reader) if t.type == tokenize.NAME)
    definitions = (ast.FunctionDef, ast.ClassDef)
    unused = [
        f"{module}.{node.name}"
        for module, path in installed(BENCH).items()
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, definitions) and used[node.name] < 2
    ]
    assert unused == []
