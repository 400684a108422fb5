"""The tutorial and the how-tos do what they say: their marked blocks are run, page by page.

The pages share a folder, so that a dataset that two of them record is recorded once.
"""

from __future__ import annotations

import configparser
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(
    page for page in (DOCS / "tutorial.md", *(DOCS / "how-to").glob("*.md"))
    if "<!-- run -->" in page.read_text("utf-8")
)  # fmt: skip
BLOCK = re.compile(
    r"<!-- (?P<what>run|file: (?P<name>[\w.-]+)) -->\n```(?P<language>\w+)\n(?P<code>.*?)```",
    re.DOTALL,
)
PAGE_TIMEOUT_S = 420

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.timeout(PAGE_TIMEOUT_S + 60),
    pytest.mark.xdist_group("how-tos"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("how-tos")


def install(project: str, folder: Path) -> None:
    """Stands for ``pip install -e .``: the package's name and entry points, without a network."""
    given = configparser.ConfigParser()
    given.read_string(project)
    name, version = (given["project"][key].strip('"') for key in ("name", "version"))
    information = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", "utf-8"
    )
    lines = []
    for section in given.sections():
        if section.startswith("project.entry-points"):
            entries = [f"{entry} = {value}" for entry, value in given[section].items()]
            lines += [
                f"[{section.split(chr(34))[1]}]",
                *(line.replace('"', "") for line in entries),
            ]
    (information / "entry_points.txt").write_text("\n".join(lines) + "\n", "utf-8")


def test_there_are_pages() -> None:
    assert len(PAGES) >= 11


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_page_does_what_it_says(page: Path, folder: Path) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(folder)}
    for block in BLOCK.finditer(page.read_text("utf-8")):
        code = block["code"]
        if block["name"] is not None:
            (folder / block["name"]).write_text(code, "utf-8")
            if block["name"] == "pyproject.toml":
                install(code, folder)
            continue
        shell = ["bash", "-euo", "pipefail", "-c"] if block["language"] == "bash" else None
        command = [*(shell or [sys.executable, "-c"]), code]
        ended = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True,
            timeout=PAGE_TIMEOUT_S, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, f"{code}\n{ended.stdout[-2000:]}\n{ended.stderr[-4000:]}"
