"""The reference in Python names everything that the package offers."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

import carstage

FOLDER = Path(__file__).parents[2] / "docs" / "reference"
DIRECTIVE = re.compile(r"^::: (carstage[\w.]*)$", re.MULTILINE)
PAGES = [page.read_text("utf-8") for page in sorted(FOLDER.glob("*.md"))]
DIRECTIVES = [name for page in PAGES for name in DIRECTIVE.findall(page)]


def found(name: str) -> object:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        module, _, attribute = name.rpartition(".")
        return getattr(importlib.import_module(module), attribute)


@pytest.mark.parametrize("name", [name for name in carstage.__all__ if name != "__version__"])
def test_what_the_package_offers_has_an_entry(name: str) -> None:
    offered = getattr(carstage, name)
    entries = [found(entry) for entry in DIRECTIVES]
    module = importlib.import_module("carstage.errors")
    assert offered in entries or (module in entries and getattr(module, name, None) is offered)


@pytest.mark.parametrize(
    "package", ["carstage.dataset", "carstage.codecs", "carstage.exporters", "carstage.testing"]
)
def test_a_public_package_is_in_the_reference(package: str) -> None:
    assert any(entry.startswith(package + ".") for entry in DIRECTIVES)


def test_every_class_of_a_dataset_has_an_entry() -> None:
    public = importlib.import_module("carstage.dataset").__all__
    assert {f"carstage.dataset.{name}" for name in public} <= set(DIRECTIVES)
