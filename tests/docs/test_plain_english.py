"""Prose that a reader takes in at once: short sentences, short cells of tables."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        ROOT / "SECURITY.md",
        *(ROOT / "docs").rglob("*.md"),
    ]
)
MOST_WORDS = 25
MOST_WORDS_OF_A_CELL = 20

FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
CODE = re.compile(r"`[^`]*`")
END = re.compile(r"(?<=[.!?])[)\"*]*\s+(?=[^a-z]|code)")
ITEM = re.compile(r"^\s*(?:[-*+]|\d+\.)\s+")
CELL = re.compile(r"(?<!\\)\|")


def words(text: str) -> int:
    """Words as one reads them: a piece of code or a link is as long as its text, code is one."""
    text = LINK.sub(r"\1", CODE.sub("code", text))
    return sum(any(c.isalnum() for c in word) for word in text.split())


def sentences(page: str) -> Iterator[tuple[int, str]]:
    """Words and text of each sentence and of each cell's sentence outside of code blocks."""
    text = COMMENT.sub("", FENCE.sub("", page))
    block: list[str] = []
    for line in [*text.splitlines(), ""]:
        starts = not line.strip() or line.lstrip().startswith(("#", "|", ">", "!!!", ":::"))
        if (starts or ITEM.match(line)) and block:
            yield from split(" ".join(block))
            block = []
        if not starts:
            block.append(ITEM.sub("", line).strip())


def split(paragraph: str) -> Iterator[tuple[int, str]]:
    for sentence in END.split(CODE.sub("code", LINK.sub(r"\1", paragraph))):
        yield words(sentence), sentence


def cells(page: str) -> Iterator[tuple[int, str]]:
    """Words and text of each cell of each table; a list of names is looked up, not read."""
    for line in COMMENT.sub("", FENCE.sub("", page)).splitlines():
        if line.startswith("|"):
            for cell in CELL.split(CODE.sub("", line))[1:-1]:
                yield words(cell), cell.strip()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_sentences_and_cells_are_short(page: Path) -> None:
    text = page.read_text("utf-8")
    long = [found for found in sentences(text) if found[0] > MOST_WORDS]
    long += [found for found in cells(text) if found[0] > MOST_WORDS_OF_A_CELL]
    assert not long, "\n".join(f"{count} words: {sentence}" for count, sentence in long)
