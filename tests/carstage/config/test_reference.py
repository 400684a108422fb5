"""The reference page is the generator's output."""

from __future__ import annotations

from pathlib import Path

from carstage.config import config_reference

PAGE = Path(__file__).parents[3] / "docs" / "configuration.md"


def test_reference_page_is_what_the_schema_generates() -> None:
    assert PAGE.read_text("utf-8") == config_reference(), (
        "run: python -c 'from carstage.config import config_reference as r; print(r(), end=\"\")' "
        "> docs/configuration.md"
    )
