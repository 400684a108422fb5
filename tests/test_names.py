"""Private names that were replaced by the field's terms do not come back."""

from __future__ import annotations

import io
import tokenize
from functools import cache
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
NAMES = yaml.safe_load((ROOT / "tests" / "private_names.yaml").read_text("utf-8"))
FOLDERS = ("src", "benchmarks", "tests", "examples")


@cache
def identifiers(path: Path) -> frozenset[str]:
    """Every identifier in a Python source; names in texts and comments do not count."""
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text("utf-8")).readline)
    return frozenset(token.string for token in tokens if token.type == tokenize.NAME)


def files_with(name: str, folders: tuple[str, ...]) -> list[str]:
    sources = (path for folder in folders for path in sorted((ROOT / folder).rglob("*.py")))
    return [str(path.relative_to(ROOT)) for path in sources if name in identifiers(path)]


@pytest.mark.parametrize("module", NAMES["modules"])
def test_module_is_gone(module: str) -> None:
    path = ROOT / "src" / module.replace(".", "/")
    left = [p for p in (path.with_suffix(".py"), path / "__init__.py") if p.exists()]
    assert not left, f"{module} became {NAMES['modules'][module]}"


@pytest.mark.parametrize("name", NAMES["identifiers"])
def test_identifier_is_gone(name: str) -> None:
    assert not files_with(name, FOLDERS), f"{name} became {NAMES['identifiers'][name]}"


@pytest.mark.parametrize(
    ("folder", "name"),
    [(folder, name) for folder, names in NAMES["identifiers_below"].items() for name in names],
)
def test_identifier_is_gone_below_its_folder(folder: str, name: str) -> None:
    assert (ROOT / folder).is_dir()
    assert not files_with(name, (folder,)), NAMES["identifiers_below"][folder][name]
