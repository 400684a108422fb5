"""The tutorial and the how-tos do what they say: their marked blocks are run, page by page."""

from __future__ import annotations

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


def test_there_are_pages() -> None:
    assert len(PAGES) >= 6


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_page_does_what_it_says(page: Path, tmp_path: Path) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(tmp_path)}
    for block in BLOCK.finditer(page.read_text("utf-8")):
        code = block["code"]
        if block["name"] is not None:
            (tmp_path / block["name"]).write_text(code, "utf-8")
            continue
        shell = ["bash", "-euo", "pipefail", "-c"] if block["language"] == "bash" else None
        command = [*(shell or [sys.executable, "-c"]), code]
        ended = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True,
            timeout=PAGE_TIMEOUT_S, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, f"{code}\n{ended.stdout[-2000:]}\n{ended.stderr[-4000:]}"
