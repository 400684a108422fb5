"""The life of runs in the page: what is told of them, and what can be done with them."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

import analytic_dataset
from axe_checks import ALL_RULES, AXE, COLOUR_RULES, settle, violations
from browser_pages import (
    Gui,
    OpenPage,
    Watch,
    field,
    picture,
    server_config,
    wait_until,
    wait_until_saved,
)
from carstage.config import dump_config, parse_config
from carstage.config import load_demo as demo_config
from carstage.plan import ServerFacts, plan_episodes
from sites import FakeRun
from small_episodes import add_episode

pytestmark = pytest.mark.xdist_group("browser")

SMALL = (
    *("episodes=1", "duration_s=0.2", "vehicles.count=0", "pedestrians.count=0"),
    *("image_size=[64, 36]",),
)
COUNTS = {"total": 2, "committed": 0, "failed": 1, "skipped": 0}


CAMPAIGN = """
name: sampled
vehicles: {count: {range: [10, 50], steps: 3}}
weather: {choice: [ClearNoon, ClearNight]}
campaign:
  method: grid
  quotas: [{name: town, frames: 20, where: {maps: [Stage01]}}]
"""


def campaign_run(out: Path) -> FakeRun:
    """A run that has ended after five of the six episodes of a campaign."""
    config = parse_config(CAMPAIGN)
    plan = plan_episodes(config, ServerFacts(maps={"Stage01": 100}))
    for spec in plan[:5]:
        add_episode(out, spec.episode_id, planned=spec.to_json())
    add_episode(out, "0123456789abcdef")  # of other settings
    description = (out / "dataset.json").read_bytes()
    run = FakeRun(out, "20260101-000004-abcdef", dump_config(config))
    (out / "dataset.json").write_bytes(description)
    run.end()
    counts = {"total": 6, "committed": 5, "failed": 0, "skipped": 0}
    run.say(state="interrupted", current=None, episodes=counts)
    return run


@pytest.fixture(scope="module")
def lives(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Gui, dict[str, FakeRun]]]:
    """A server over runs that have failed, were killed, were stopped, and one that goes on."""
    folder = tmp_path_factory.mktemp("lives") / "datasets"
    folder.mkdir()
    analytic_dataset.make_dataset(folder / "scene", tmp_path_factory.mktemp("scene"))
    description = (folder / "scene" / "dataset.json").read_bytes()
    runs: dict[str, FakeRun] = {}
    for number, name in enumerate(("failed", "killed", "stopped", "going")):
        other = ("seed=8", "rig.sensors[CAM_FRONT].attributes.fov_deg=60")
        config = dump_config(
            demo_config((*SMALL, f"name={name}", *(other if name == "killed" else ())))
        )
        out = folder / ("scene" if name == "failed" else name)
        runs[name] = FakeRun(out, f"20260101-00000{number}-abcdef", config)
    (folder / "scene" / "dataset.json").write_bytes(description)
    for name in ("failed", "killed", "stopped"):
        runs[name].end()
    over: dict[str, Any] = {"current": None, "episodes": COUNTS}
    runs["failed"].say(state="failed", message="Episode e1 failed: it broke.", **over)
    runs["stopped"].say(state="interrupted", **over)
    runs["going"].event("episode_retried", episode_id="e2", reason="The server ended.")
    runs["going"].say(current={**runs["going"]._status["current"], "attempt": "a2"})
    runs["sampled"] = campaign_run(folder / "sampled")
    made = Gui(folder)
    made.start()
    try:
        yield made, runs
    finally:
        made.stop()
        runs["going"].end()


@pytest.fixture(scope="module")
def gui(lives: tuple[Gui, dict[str, FakeRun]]) -> Gui:
    return lives[0]


@pytest.fixture
def runs(lives: tuple[Gui, dict[str, FakeRun]]) -> dict[str, FakeRun]:
    return lives[1]


def at(run: FakeRun) -> str:
    return f"#/run/{run.folder.name}"


def action(page: Page, name: str, of: str = "run") -> None:
    page.get_by_role("button", name=f"Actions: {of}").click()
    page.get_by_role("menuitem", name=name).click()


def tile(page: Page, name: str) -> Locator:
    return page.locator(".tile").filter(has_text=name).locator("dd")


def test_each_end_of_a_run_is_told_as_it_was(
    open_page: OpenPage, runs: dict[str, FakeRun], gui: Gui
) -> None:
    page = open_page(at(runs["failed"]))
    head = page.locator(".page-head")
    told = {
        "failed": ("failed", "Retry", "Episode e1 failed: it broke."),
        "killed": ("died", "Resume", "Its process is gone"),
        "stopped": ("stopped", "Resume", ""),
    }
    for name, (badge, button, message) in told.items():
        page.evaluate(f"location.hash = '{at(runs[name])}'")
        expect(page.get_by_role("heading", level=1)).to_have_text(name)
        expect(head.get_by_role("status").first).to_have_text(badge)
        expect(head.get_by_role("button", name=button)).to_be_visible()
        if message:
            expect(head.get_by_role("alert")).to_contain_text(message)
        # The dataset ``scene`` holds an episode, which is of another run.
        expect(page.get_by_label("Pictures")).to_have_text("This run has committed no episode.")
        expect(page.locator(".place code").first).to_have_text(str(runs[name].folder.parents[1]))
        took = tile(page, "Took").inner_text()
        page.wait_for_timeout(1500)
        assert tile(page, "Took").inner_text() == took
    picture(page, "gui-run-stopped.png", gui)


def test_a_second_attempt_is_marked_with_its_reason(
    open_page: OpenPage, runs: dict[str, FakeRun]
) -> None:
    page = open_page(at(runs["going"]))
    expect(page.locator(".attempt")).to_contain_text("attempt 2")
    expect(page.locator(".attempt")).to_contain_text("The server ended.")


def test_load_and_speed_are_drawn_with_axes_and_read_by_pointer_and_keys(
    open_page: OpenPage, runs: dict[str, FakeRun], gui: Gui
) -> None:
    run = runs["going"]
    page = open_page(at(run))
    memory = page.get_by_role("figure").filter(has_text="Memory")
    load = page.get_by_role("region", name="Speed and load")
    expect(load.get_by_text("No measurements yet")).to_have_count(1)
    expect(memory).to_have_count(0)
    status = run._status
    for second in range(8):
        time_s = status["pid_started"] + 10.0 + second
        for worker in (1, 2):
            tick = {"episode_id": f"e{worker}", "tick": 10 * second * worker, "queued_bytes": 5000}
            run.event("tick", worker=worker, k=second * worker, time=time_s, waited_s=0, **tick)
        taken = {"cpu_cores": 1.5, "memory_bytes": 10**9 * (second + 1), "written_bytes_s": 2e6}
        run.event("load", time=time_s, disk_free_bytes=10**10, **taken)
    expect(memory).to_contain_text("now 8.0 GB, at most 8.0 GB")
    expect(memory.locator(".chart-label").first).to_have_text("0 B")
    chart = memory.get_by_role("group")
    chart.hover(position={"x": 62, "y": 40})
    expect(memory.get_by_role("status")).to_have_text("1.0 GB at 10 s")
    page.mouse.move(0, 0)
    chart.focus()
    page.keyboard.press("ArrowLeft")
    expect(memory.get_by_role("status")).to_have_text("8.0 GB at 17 s")
    page.keyboard.press("ArrowLeft")
    expect(memory.get_by_role("status")).to_have_text("7.0 GB at 16 s")
    frames = page.get_by_role("figure").filter(has_text="Saved frames")
    for worker in (1, 2):
        page.get_by_role("button", name=f"worker {worker}").click()
        expect(frames).to_contain_text(f"at most {worker}.00/s")
    page.get_by_role("group", name="Workers").get_by_role("button", name="all").click()
    expect(frames).to_contain_text("at most 3.00/s")
    picture(page, "gui-run-load.png", gui, load)


def test_a_run_without_measurements_says_so_once(
    open_page: OpenPage, runs: dict[str, FakeRun]
) -> None:
    runs["stopped"].event("server_lost", reason="it fell over")
    page = open_page(at(runs["stopped"]))
    load = page.get_by_role("region", name="Speed and load")
    expect(load).to_have_text("Speed and loadNo measurements")
    expect(load.get_by_role("figure")).to_have_count(0)
    expect(page.get_by_label("Log", exact=True)).to_contain_text(re.compile(r"Log1 warning(?!s)"))


def measured(run: FakeRun, seconds: int, cores: float, memory_bytes: int) -> None:
    """Loads and ticks of a run, every second from its begin."""
    for second in range(seconds):
        time_s = run._status["pid_started"] + 1.0 + second
        tick = {"episode_id": "e1", "tick": 10 * second, "queued_bytes": 5000}
        run.event("tick", k=5 * second, time=time_s, waited_s=0, **tick)
        taken = {"cpu_cores": cores, "memory_bytes": memory_bytes, "written_bytes_s": 2e6}
        run.event("load", time=time_s, disk_free_bytes=10**10, **taken)


def test_why_a_log_has_no_line_is_told_in_one_line(
    open_page: OpenPage, runs: dict[str, FakeRun]
) -> None:
    page = open_page(at(runs["sampled"]))
    log = page.get_by_label("Log", exact=True)
    log.get_by_role("button", name="warnings").click()
    why = log.get_by_text("There is neither a warning nor an error.")
    assert why.evaluate("(line) => line.getBoundingClientRect().height") < 30


def test_of_a_run_that_has_ended_the_end_is_told_and_no_label_of_an_axis_is_cut(
    open_page: OpenPage, runs: dict[str, FakeRun]
) -> None:
    run = runs["stopped"]
    for time_s in (15.0, 90.0):
        taken = {"cpu_cores": 1.5, "memory_bytes": 10**9, "written_bytes_s": 105e6}
        run.event("load", time=run._status["pid_started"] + time_s, disk_free_bytes=1, **taken)
    page = open_page(at(run))
    written = page.get_by_role("figure").filter(has_text="Written to disks")
    expect(written.get_by_role("status")).to_have_text("at the end 105 MB/s, at most 105 MB/s")
    labels = written.locator(".chart-label").evaluate_all(
        """(all) => all.map((one) => {
          const [text, chart] = [one, one.ownerSVGElement].map((x) => x.getBoundingClientRect());
          return [one.textContent, text.left >= chart.left && text.right <= chart.right];
        })"""
    )
    assert {"50.0 MB/s", "1 min 30 s"} <= {text for text, _ in labels}
    assert [text for text, whole in labels if not whole] == []


def test_runs_are_compared_on_common_axes_at_one_address(
    open_page: OpenPage, runs: dict[str, FakeRun], gui: Gui
) -> None:
    one, two = runs["failed"], runs["killed"]
    measured(one, 20, 1.5, 10**9)
    measured(two, 10, 3.0, 2 * 10**9)
    page = open_page("#/runs")
    expect(page.get_by_role("button", name="Compare", exact=True)).to_be_disabled()
    for name in ("failed", "killed"):
        page.get_by_role("checkbox", name=f"Compare {name}").check()
    page.reload()
    expect(page.get_by_role("checkbox", name="Compare killed")).to_be_checked()
    page.get_by_role("link", name="Compare 2 runs").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Runs compared")
    assert page.url.endswith(f"#/compare?run={one.folder.name}&run={two.folder.name}")
    table = page.get_by_role("table")
    row = {name: table.get_by_role("row").filter(has_text=name) for name in ("State", "CPU")}
    expect(row["State"].get_by_role("cell")).to_have_text(["failed", "died"])
    expect(row["CPU"].get_by_role("cell")).to_have_text(["1.50 cores", "3.00 cores"])
    settings = table.locator("tbody").nth(1).get_by_role("row")
    expect(settings).to_have_count(3)  # the heading, and the two that differ
    expect(settings.nth(1)).to_contain_text("Seed")
    expect(settings.nth(2).get_by_role("cell")).to_have_text(["90", "60"])

    memory = page.get_by_role("figure").filter(has_text="Memory")
    expect(memory.locator(".chart-line")).to_have_count(2)
    expect(memory.get_by_role("status")).to_have_text("at most 2.0 GB")
    chart = memory.get_by_role("group")
    chart.hover(position={"x": 62, "y": 40})
    expect(memory.get_by_role("status")).to_have_text("failed 1.0 GB, killed 2.0 GB at 1 s")
    page.mouse.move(0, 0)
    chart.focus()
    page.keyboard.press("ArrowLeft")  # the last second, which the shorter one has not reached
    expect(memory.get_by_role("status")).to_have_text("failed 1.0 GB at 20 s")
    chart.blur()
    page.mouse.move(0, 0)
    picture(page, "gui-compare.png", gui)
    page.get_by_role("button", name="Copy as command").click()
    expect(page.get_by_label("Command", exact=True)).to_have_text(
        f"carstage runs compare {one.folder} {two.folder}"
    )
    page.get_by_role("button", name="Close").click()
    page.get_by_role("link", name="Choose runs").click()
    expect(page.get_by_role("checkbox", name="Compare killed")).to_be_checked()
    page.get_by_role("checkbox", name="Compare killed").uncheck()
    expect(page.get_by_role("link", name="Compare 2 runs")).to_have_count(0)


def test_comparison_and_campaign_fit_every_screen_in_both_themes_and_axe_finds_nothing(
    open_page: OpenPage, runs: dict[str, FakeRun]
) -> None:
    if not AXE.exists():
        pytest.skip("no axe-core: npm ci in ui/")
    measured(runs["sampled"], 15, 2.0, 10**8)
    chosen = "&".join(f"run={run.folder.name}" for run in runs.values())
    page = open_page(f"#/compare?{chosen}")
    page.get_by_role("figure").first.wait_for()
    page.evaluate(AXE.read_text())
    found = []
    for theme in ("dark", "light"):
        rules = ALL_RULES if theme == "dark" else COLOUR_RULES
        for width, height in ((1440, 900), (1024, 768), (768, 1024), (390, 844)):
            page.set_viewport_size({"width": width, "height": height})
            settle(page)
            look(page, f"compare-{theme}-{width}")
            found += [f"{width} {theme} {wrong}" for wrong in violations(page, rules)]
            inner = page.evaluate("document.getElementById('content').scrollWidth")
            assert inner <= width, (theme, width)
        page.evaluate("location.hash = '#/datasets/sampled?tab=campaign'")
        page.locator(".coverage-table").first.wait_for()
        for width in (1440, 390):
            page.set_viewport_size({"width": width, "height": 900})
            settle(page)
            look(page, f"campaign-{theme}-{width}")
            found += [f"campaign {width} {theme} {wrong}" for wrong in violations(page, rules)]
        page.get_by_role("button", name="Light theme").or_(
            page.get_by_role("button", name="Dark theme")
        ).click()
        page.evaluate(f"location.hash = '#/compare?{chosen}'")
        page.locator(".line-chart").first.wait_for()
    assert found == []


def look(page: Page, name: str) -> None:
    """A picture to be looked at, where a folder for it is named."""
    if folder := os.environ.get("CARSTAGE_LOOK"):
        page.screenshot(path=Path(folder) / f"{name}.png", full_page=True)


def test_a_campaign_shows_what_of_it_is_recorded(
    open_page: OpenPage, runs: dict[str, FakeRun], gui: Gui
) -> None:
    page = open_page("#/datasets/scene")
    page.get_by_role("tab", name="Statistics").wait_for()
    expect(page.get_by_role("tab", name="Campaign")).to_have_count(0)
    page.evaluate("location.hash = '#/datasets/sampled'")
    page.get_by_role("tab", name="Campaign").click()
    tiles = page.locator(".campaign .tile")
    expect(tiles).to_have_text(
        ["Planned6", "Recorded5", "Missing1", "Sampledgrid", "Combinations5 of 6"]
    )
    expect(page.locator(".campaign .page-head")).to_contain_text(
        "1 episode of the dataset of other"
    )
    vehicles = page.get_by_role("region", name="Coverage of Vehicles").get_by_role("row")
    expect(vehicles).to_have_count(4)
    expect(vehicles.nth(1)).to_have_text(re.compile("^102 of 20$"))
    missing = page.get_by_role("region", name="Coverage of Weather").locator(".short")
    expect(missing).to_have_text(["1"])
    quota = page.get_by_role("region", name="Coverage of Quotas").get_by_role("row").nth(1)
    expect(quota).to_have_text("town20 of 200")
    expect(page.get_by_text("the missing episodes are not needed")).to_be_visible()
    picture(page, "gui-campaign.png", gui)
    page.get_by_role("button", name="Copy as command").click()
    expect(page.get_by_label("Command", exact=True)).to_contain_text(
        f"carstage campaign report {gui.datasets / 'sampled'} - <<'CONFIG'"
    )


def test_validation_and_report_are_shown_as_commands(open_page: OpenPage, gui: Gui) -> None:
    for tab, command in (("Validation", "validate"), ("Report", "report")):
        page = open_page("#/datasets/scene")
        page.get_by_role("tab", name=tab).or_(page.get_by_role("button", name=tab)).first.click()
        page.get_by_role("button", name="Copy as command").click()
        shown = page.get_by_label("Command", exact=True)
        expect(shown).to_have_text(f"carstage {command} {gui.datasets / 'scene'}")


def test_a_run_is_renamed_and_its_command_shown(
    open_page: OpenPage, runs: dict[str, FakeRun]
) -> None:
    run = runs["stopped"]
    page = open_page(at(run))
    action(page, "Rename…")
    page.get_by_label("Name", exact=True).fill("Rain at night")
    page.get_by_role("button", name="Rename", exact=True).click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Rain at night")
    action(page, "Resume as command")
    where = str(run.folder.parents[1])
    expect(page.get_by_label("Command", exact=True)).to_have_text(
        f"carstage runs resume {where} {run.folder.name}"
    )
    page.get_by_role("button", name="Close").click()
    page.reload()
    expect(page.get_by_role("heading", level=1)).to_have_text("Rain at night")
    action(page, "Rename…")
    page.get_by_label("Name", exact=True).fill("stopped")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("stopped")


def test_a_run_is_deleted_after_a_question(open_page: OpenPage, runs: dict[str, FakeRun]) -> None:
    run = runs["killed"]
    copy = FakeRun(run.folder.parents[1], "20260102-000000-abcdef", {"name": "to delete"})
    copy.end()
    copy.say(state="failed", message="it broke")
    page = open_page(at(copy))
    action(page, "Delete…")
    page.get_by_role("button", name="Cancel").click()
    assert copy.folder.exists()
    action(page, "Delete…")
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page.get_by_role("link", name="to delete")).to_have_count(0)
    assert not copy.folder.exists()


def test_a_configuration_comes_back_into_the_form(
    open_page: OpenPage, runs: dict[str, FakeRun]
) -> None:
    page = open_page(at(runs["stopped"]))
    action(page, "Load this configuration")
    wait_until_saved(page)
    expect(field(page, "Name").first).to_have_value("stopped")
    assert server_config(page)["duration_s"] == 0.2
    page.get_by_role("button", name="Undo").click()
    expect(field(page, "Name").first).not_to_have_value("stopped")


def test_a_stopped_run_goes_on_by_one_click(open_page: OpenPage, runs: dict[str, FakeRun]) -> None:
    """The one that goes on here holds this machine's place, so the new one waits in the queue."""
    run = runs["stopped"]
    page = open_page(at(run))
    page.get_by_role("button", name="Resume").click()
    expect(page.get_by_text(f"goes on with {run.folder.name}")).to_be_visible()
    expect(page.locator(".page-head").get_by_role("status").first).to_contain_text("queued")
    page.get_by_role("button", name="Take out").click()


def test_a_failed_run_is_retried_and_duplicated_by_its_buttons(
    open_page: OpenPage, runs: dict[str, FakeRun], gui: Gui
) -> None:
    """Both wait behind the run that goes on, with the settings of the one that failed."""
    run = runs["failed"]
    page = open_page(at(run))
    expect(page.get_by_role("button", name="Resume")).to_have_count(0)
    badge = page.locator(".page-head").get_by_role("status").first
    recorded = into(gui, run.folder.parents[1].name)

    page.get_by_role("button", name="Retry").click()
    expect(page.get_by_text(f"goes on with {run.folder.name}")).to_be_visible()
    expect(badge).to_have_text("queued, place 1")
    retried = page.evaluate(RUN_OF_PAGE)
    assert retried["run"]["location"] == str(run.folder.parents[1])
    assert retried["config"] == recorded
    page.get_by_role("button", name="Take out").click()

    page.evaluate(f"location.hash = '{at(run)}'")
    expect(page.get_by_role("heading", level=1)).to_have_text("failed")
    action(page, "Duplicate…")
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_label("Into the dataset")).to_have_value("scene-2")
    dialog.get_by_label("Into the dataset").fill("no/name")
    dialog.get_by_role("button", name="Queue").click()
    expect(dialog.get_by_role("alert")).to_be_visible()
    dialog.get_by_label("Into the dataset").fill("scene-copy")
    dialog.get_by_role("button", name="Queue").click()
    expect(page.get_by_text("goes on with")).to_have_count(0)
    expect(badge).to_have_text("queued, place 1")
    copied = page.evaluate(RUN_OF_PAGE)
    assert copied["run"]["location"] == str(gui.datasets / "scene-copy")
    assert copied["config"] == recorded
    page.get_by_role("button", name="Take out").click()
    expect(page.get_by_text("queued, place 1")).to_have_count(0)


#: What the server says of the run that the address names.
RUN_OF_PAGE = "fetch(`api/runs/${location.hash.split('/').at(-1)}`).then((a) => a.json())"


def into(gui: Gui, dataset: str) -> dict[str, Any]:
    """The settings of the run that has recorded into a dataset."""
    (plan,) = (gui.datasets / dataset / "runs").glob("*/plan.json")
    document: dict[str, Any] = json.loads(plan.read_text())
    config: dict[str, Any] = document["config"]
    return config


def test_all_runs_stand_in_one_table(open_page: OpenPage, gui: Gui) -> None:
    page = open_page("#/runs")
    rows = page.locator(".runs-table tbody tr")
    expect(rows.filter(has_text="failed").first).to_contain_text("scene")
    page.get_by_role("button", name="active").click()
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("going")
    page.get_by_role("button", name="not finished").click()
    expect(rows.filter(has_text="going")).to_have_count(0)
    page.get_by_label("Search the runs").fill("killed")
    expect(rows).to_have_count(1)
    picture(page, "gui-runs.png", gui)


def test_what_is_not_there_is_said_and_never_loads_for_ever(
    open_page: OpenPage, watch: Watch, runs: dict[str, FakeRun]
) -> None:
    watch.may_ask_in_vain = True
    page = open_page("#/runs")
    there = runs["failed"].folder.name
    content = page.locator("#content")
    for address, told in (
        ("#/datasets/nowhere", "There is no dataset nowhere."),
        ("#/datasets/nowhere?tab=campaign", "There is no dataset nowhere."),
        ("#/datasets/nowhere/0123456789abcdef", "There is no dataset nowhere."),
        ("#/datasets/scene/fedcba9876543210", "There is no episode fedcba9876543210"),
        ("#/run/nowhere", "There is no such run."),
        (f"#/compare?run={there}&run=nowhere", "There is no run nowhere."),
        (f"#/compare?run={there}", "Choose two or more runs"),
    ):
        page.evaluate(f"location.hash = '{address}'")
        expect(content).to_contain_text(told)
        expect(content).not_to_contain_text("Loading")


def test_a_double_click_on_stop_asks_once(
    open_page: OpenPage, runs: dict[str, FakeRun], gui: Gui
) -> None:
    """The run minds no signal, so that it goes on; the second one would end it at once."""
    run = FakeRun(gui.datasets / "long", "20260102-000001-abcdef", {}, minds_signals=False)
    try:
        page = open_page(at(run))
        page.get_by_role("button", name="Stop").dblclick()
        expect(page.get_by_role("button", name="Stop at once")).to_be_visible()
        page.wait_for_timeout(1500)  # a second press would be told of by now
        assert page.evaluate(RUN_OF_PAGE)["run"]["stop"] == 1
        page.get_by_role("button", name="Stop at once").click()
        wait_until(page, f"{RUN_OF_PAGE}.then((a) => a.run.stop === 2)")
    finally:
        run.end()


def test_the_shortcuts_are_listed(open_page: OpenPage) -> None:
    page = open_page("#/runs")
    page.get_by_role("heading", level=1).wait_for()
    page.keyboard.press("?")
    dialog = page.get_by_role("dialog", name="Keyboard shortcuts")
    expect(dialog).to_contain_text("Space")
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    page.evaluate("location.hash = '#/run'")
    links = page.locator(".run-list li a")
    links.first.focus()
    page.keyboard.press("ArrowDown")
    expect(links.nth(1)).to_be_focused()


SCREENS = ((390, 844), (720, 450), (768, 1024), (1024, 768), (1440, 900))


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_start_is_in_view_and_nothing_wider_than_the_screen(
    open_page: OpenPage, theme: str, runs: dict[str, FakeRun]
) -> None:
    """Each page is loaded on the smallest screen, which then grows: loading is the dear part."""
    width, height = SCREENS[0]
    page = open_page(width=width, height=height, theme=theme)
    start = page.get_by_role("button", name=re.compile("Start|Queue"))
    start.wait_for()
    for address in ("#/configure", "#/run", "#/runs", at(runs["failed"]), "#/datasets/scene",
                    "#/datasets/sampled?tab=campaign"):  # fmt: skip
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(f"location.hash = '{address}'")
        page.get_by_role("heading", level=1).first.wait_for(state="attached")
        page.wait_for_load_state("networkidle")
        wait_until(page, "document.fonts.status === 'loaded'")
        for screen in SCREENS:
            page.set_viewport_size({"width": screen[0], "height": screen[1]})
            wait_until(page, f"innerWidth === {screen[0]}")
            if address == "#/configure":
                check_form(page, start, *screen)
            # Charts take their new width when they are told of it, a moment later.
            wide = "document.documentElement.scrollWidth"
            inner = "document.getElementById('content').scrollWidth"
            wait_until(page, f"Math.max({wide}, {inner}) <= {screen[0]}", (address, screen))
            look(page, f"{screen[0]}-{theme}-{address.strip('#/').replace('/', '-')[:20]}")


def check_form(page: Page, start: Locator, width: int, height: int) -> None:
    """The button that starts a run is in view; on small screens the parameters come first."""
    box = start.bounding_box()
    assert box is not None
    assert box["y"] >= 0, (width, height)
    assert box["y"] + box["height"] <= height, (width, height)
    if width < 900:
        tops = [
            page.locator(where).evaluate("(e) => e.getBoundingClientRect().top")
            for where in (".parameters", ".rig")
        ]
        assert tops[0] < tops[1], (width, height)
