"""A kind of sensor that the how-to invents, through the public entry point alone.

Its package has a row of the table, a class of the collector, one of the simulator, and a codec.
That it is recorded and validated is what the page's own blocks show, see ``tests/docs``.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from browser_pages import Gui, Watch, field
from page_blocks import files_of, write

ROOT = Path(__file__).parents[4]
PAGE = ROOT / "docs" / "how-to" / "add-a-sensor-kind.md"
CONFIG = "thermal.yaml"
FASTER = ("--set", "server.self_test=off", "--set", "conversion.workers=1")
PACKAGE = {
    "thermal_kind.py",
    "thermal_collector.py",
    "thermal_codec.py",
    "thermal_simulator.py",
    "pyproject.toml",
}

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.timeout(240)]


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The how-to's package, and a configuration that uses it."""
    folder = tmp_path_factory.mktemp("thermal")
    for name, text in files_of(PAGE).items():
        write(name, text, folder)
    return folder


def record(
    config: Path, out: Path, installed: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """``carstage run`` where the package of a folder is installed, or none."""
    return subprocess.run(
        [sys.executable, "-m", "carstage.cli", "run", str(config), "--out", str(out), *FASTER],
        cwd=out.parent.parent, env={**os.environ, "PYTHONPATH": str(installed or "")},
        capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def recorded(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recorded") / "datasets" / "thermal"
    out.parent.mkdir()
    done = record(package / CONFIG, out, installed=package)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture
def page(
    browser: Browser, package: Path, recorded: Path, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Page]:
    monkeypatch.setenv("PYTHONPATH", str(package))
    gui = Gui(recorded.parent)
    gui.start()
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    try:
        page = context.new_page()
        watch.follow(page)
        page.goto(gui.url)
        yield page
    finally:
        context.close()
        gui.stop()


def test_it_takes_a_row_a_class_on_each_side_and_a_codec() -> None:
    assert set(files_of(PAGE)) == {*PACKAGE, CONFIG}
    sources = [*(ROOT / "src").rglob("*.py"), *(ROOT / "ui" / "src").rglob("*.ts*")]
    assert not [path for path in sources if re.search("thermal", path.read_text("utf-8"), re.I)]


def test_where_it_is_not_installed_it_is_refused_at_its_path(package: Path, tmp_path: Path) -> None:
    done = record(package / CONFIG, tmp_path / "datasets" / "none")
    assert done.returncode == 2
    assert "rig.sensors[1].kind: unknown kind 'thermal'" in done.stderr
    assert not (tmp_path / "datasets").exists()


def test_an_attribute_of_it_is_checked(package: Path, tmp_path: Path) -> None:
    config = tmp_path / "wrong.yaml"
    config.write_text((package / CONFIG).read_text("utf-8").replace("0.02", "2"), "utf-8")
    done = record(config, tmp_path / "datasets" / "none", installed=package)
    assert done.returncode == 2
    assert "rig.sensors[1].attributes.absorbed_per_m" in done.stderr


def test_a_simulator_names_a_plugin_that_it_cannot_import() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "carstage_sim", "--plugin", "no_such_module"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert (
        done.stderr == "carstage_sim: --plugin no_such_module: No module named 'no_such_module'\n"
    )


def test_the_interface_offers_and_shows_it(page: Page) -> None:
    page.goto(page.url.split("#")[0] + "#/configure")
    page.get_by_role("heading", name="Sensor rig").click()
    page.get_by_role("button", name="More: other kinds of sensor").click()
    page.get_by_role("menuitem", name="Thermal camera").click()
    page.locator(".inspector summary", has_text="More").click()
    expect(field(page, "Absorption")).to_be_visible()
    page.goto(page.url.split("#")[0] + "#/datasets/thermal")
    page.get_by_role("link", name="Episode 1").click()
    page.get_by_role("button", name="Show THERMAL_FRONT large").click()
    shown = page.locator(".scene-cameras .camera").filter(has_text="THERMAL_FRONT")
    expect(shown).to_have_attribute("data-k", "0")
    shown.locator(".object").first.wait_for()
