"""What the interface's bench needs, and what its figures are made of."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from benchmarks.framework.gui.chromium import chromium
from benchmarks.framework.gui.thumbnails import CAMERAS, Drawn, Watched
from carstage.errors import BadInputError

ROOT = Path(__file__).parents[3]


def watched(ages_s: list[float]) -> Watched:
    """Every camera shows a picture each tenth of a second, as old as is given for its second."""
    pictures = [
        Drawn(f"CAM_{camera}", 10 * second + tenth, 100.0 + second + tenth / 10, age_s)
        for second, age_s in enumerate(ages_s)
        for tenth in range(10)
        for camera in range(CAMERAS)
    ]
    return Watched(0, 60, pictures, float(len(ages_s)), 12.0)


def test_the_slowest_camera_counts() -> None:
    whole = watched([0.1, 0.1])
    assert whole.rate_hz() == 10.0
    gap = [p for p in whole.pictures if p.sensor != "CAM_3" or p.tick % 2]
    assert Watched(0, 60, gap, 2.0, 12.0).rate_hz() == 5.0
    silent = [p for p in whole.pictures if p.sensor != "CAM_3"]
    assert Watched(0, 60, silent, 2.0, 12.0).rate_hz() == 0.0


def test_ages_are_those_of_the_asked_time() -> None:
    run = watched([0.1, 0.2, 0.3])
    assert run.age_s(0.0, 0.95) == 0.1
    assert run.age_s(2.0, 3.0) == 0.3
    assert math.isnan(run.age_s(5.0, 6.0)), "no pictures meet no target"


def test_without_a_browser_it_says_how_to_get_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CARSTAGE_CHROMIUM", raising=False)
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(BadInputError) as refused, chromium():
        pass
    assert "apt-get install chromium" in refused.value.hint
    monkeypatch.setitem(__import__("sys").modules, "playwright.sync_api", None)
    with pytest.raises(BadInputError) as refused, chromium():
        pass
    assert "pip install playwright" in refused.value.hint


def test_what_is_looked_for_in_the_page_is_in_its_sources() -> None:
    page = "".join(path.read_text("utf-8") for path in (ROOT / "ui" / "src").rglob("*.tsx"))
    selectors = [
        selector
        for path in (ROOT / "benchmarks" / "framework" / "gui").glob("*.py")
        for selector in re.findall(
            r"""(?:locator\(f?|querySelector\(|closest\(|^_[A-Z]+ = )(["'])(.+?)\1""",
            path.read_text("utf-8"),
            re.MULTILINE,
        )
    ]
    names = {name for _, text in selectors for name in re.findall(r"\.([a-z]+(?:-[a-z]+)*)", text)}
    assert {"scene-host", "sensor-preview", "thumbs"} <= names
    missing = {
        name
        for name in names
        if not re.search(rf"\b{name}\b", page) and f"{name.split('-')[0]}-${{" not in page
    }
    assert missing == set()
