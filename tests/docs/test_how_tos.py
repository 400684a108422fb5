"""The tutorial and the how-tos do what they say: their marked blocks are run, page by page.

The pages share a folder, so that a dataset that two of them record is recorded once. Configurations
get lines for what changes no byte of a dataset and takes as long as recording one, see ``UNSAID``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from page_blocks import BLOCK, write

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(
    page for page in (DOCS / "tutorial.md", *(DOCS / "how-to").glob("*.md"))
    if "<!-- run -->" in page.read_text("utf-8")
)  # fmt: skip
PAGE_TIMEOUT_S = 420
UNSAID = {"server": 'server: {self_test: "off"}', "conversion": "conversion: {workers: 1}"}
"""Sections that a page's configuration gets if it says nothing of them."""

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.timeout(PAGE_TIMEOUT_S + 60),
    pytest.mark.xdist_group("how-tos"),
]


def as_recorded(name: str, text: str) -> str:
    """A page's file; configurations with what they leave unsaid."""
    given = yaml.safe_load(text) if name.endswith(".yaml") else {}
    if "duration_s" not in given:
        return text
    return text + "".join(f"{line}\n" for key, line in UNSAID.items() if key not in given)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("how-tos")


def test_there_are_pages() -> None:
    assert len(PAGES) >= 11


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_page_does_what_it_says(page: Path, folder: Path) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(folder)}
    environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # pages that test need none of our plugins
    for block in BLOCK.finditer(page.read_text("utf-8")):
        code = block["code"]
        if block["name"] is not None:
            write(block["name"], as_recorded(block["name"], code), folder)
            continue
        shell = ["bash", "-euo", "pipefail", "-c"] if block["language"] == "bash" else None
        command = [*(shell or [sys.executable, "-c"]), code]
        ended = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True,
            timeout=PAGE_TIMEOUT_S, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, f"{code}\n{ended.stdout[-2000:]}\n{ended.stderr[-4000:]}"
