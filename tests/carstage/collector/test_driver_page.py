"""A device at the page: its states become commands, and without them the car brakes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import carla
import pytest

from carstage.collector.drivers.driving import command_of
from carstage.collector.drivers.inputs import Gamepad, Keyboard
from carstage.collector.drivers.page import GONE_S, PATIENCE_S, PageDevice, PageDriver, read_state
from carstage.collector.internals.errors import DriverError

STEP_S = 0.05
NUMBERS = {"steer_axis": 0, "throttle_axis": 5, "brake_axis": 2, "reverse_button": 1,
           "hand_brake_button": 0}  # fmt: skip
LET_GO = [0.0, 0.0, -1.0, 0.0, 0.0, -1.0]


class Page:
    """Writes what a page would have its server write, by a clock of its own."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "inputs.json"
        self.now_s = 100.0
        self.sequence = 0
        self.pauses: list[float] = []

    def send(self, sender: str = "one", **state: Any) -> None:
        self.sequence += 1
        whole = {"held": [], "presses": {}, "axes": [], **state}
        whole.update(sender=sender, sequence=self.sequence)
        self.path.write_text(json.dumps(whole))

    def clock(self) -> float:
        return self.now_s

    def pause(self, seconds: float) -> None:
        self.pauses.append(seconds)
        self.now_s += seconds


@pytest.fixture
def page(tmp_path: Path) -> Page:
    return Page(tmp_path)


class Ego:
    def get_control(self) -> Any:
        return carla.VehicleControl(gear=1)


class Seen:
    """As much of an observation as the driver looks at."""

    ego = Ego()
    tick = 0


def driver_of(page: Page, inputs: Any) -> PageDriver:
    device = PageDevice(str(page.path), inputs, page.clock)
    return PageDriver(device, inputs, STEP_S, page.pause, page.clock)


def drive(driver: PageDriver) -> Any:
    return command_of(driver.drive(Seen()))  # type: ignore[arg-type]


def test_a_pad_drives_by_its_axes_once_they_have_moved(page: Page) -> None:
    driver = driver_of(page, Gamepad(NUMBERS))
    page.send(axes=LET_GO)
    driver.start(Seen())  # type: ignore[arg-type]
    assert drive(driver).throttle == 0.0
    page.send(axes=[-0.5, 0.0, -1.0, 0.0, 0.0, 0.5], held=["button0"], presses={"button0": 1})
    now = drive(driver)
    assert (now.throttle, now.steer, now.brake, now.hand_brake) == pytest.approx((0.75, -0.5, 0, 1))
    page.send(axes=[-0.5, 0.0, -1.0, 0.0, 0.0, 0.5], presses={"button0": 1, "button1": 1})
    now = drive(driver)
    assert (now.hand_brake, now.reverse, now.gear) == (0, 1, -1)


def test_a_press_that_is_over_before_a_step_counts(page: Page) -> None:
    keys = Keyboard()
    driver = driver_of(page, keys)
    page.send(presses={"q": 7})
    driver.start(Seen())  # type: ignore[arg-type]
    assert drive(driver).reverse == 0, "what was pressed before the drive"
    page.send(presses={"q": 8})
    assert drive(driver).reverse == 1
    page.send(presses={"q": 10}, held=["w"])
    now = drive(driver)
    assert (now.reverse, now.throttle) == (1, 0.0), "w was held and never pressed"
    page.send(presses={"q": 10, "w": 1}, held=["w"])
    assert drive(driver).throttle == pytest.approx(0.1)


def test_a_page_that_is_gone_leaves_a_car_that_brakes(page: Page) -> None:
    driver = driver_of(page, Gamepad(NUMBERS))
    page.send(axes=LET_GO)
    driver.start(Seen())  # type: ignore[arg-type]
    page.send(axes=[0.3, 0.0, -1.0, 0.0, 0.0, 1.0])
    driven = [drive(driver) for _ in range(round(2 * GONE_S / STEP_S))]
    assert (driven[0].throttle, driven[0].brake) == (1.0, 0.0)
    braked = [command.brake for command in driven].index(1.0)
    assert braked * STEP_S == pytest.approx(GONE_S, abs=2 * STEP_S)
    assert all(one.throttle == 0.0 and one.brake == 1.0 for one in driven[braked:])
    assert driven[-1].steer == pytest.approx(0.3)
    page.send(axes=[0.3, 0.0, -1.0, 0.0, 0.0, 0.0])
    assert drive(driver).throttle == pytest.approx(0.5), "it is back"


def test_another_page_takes_over_with_nothing_pressed(page: Page) -> None:
    driver = driver_of(page, Keyboard())
    page.send(held=["w"], presses={"w": 1})
    driver.start(Seen())  # type: ignore[arg-type]
    assert drive(driver).throttle == pytest.approx(0.1)
    page.send("two", presses={"q": 3})
    now = drive(driver)
    assert (now.throttle, now.reverse) == (0.0, 0)


def test_steps_go_at_the_pace_of_the_clock(page: Page) -> None:
    driver = driver_of(page, Keyboard())
    page.send()
    driver.start(Seen())  # type: ignore[arg-type]
    begin_s = page.now_s
    for _ in range(10):
        page.send()
        drive(driver)
    assert page.now_s - begin_s == pytest.approx(10 * STEP_S)


def test_a_page_that_nobody_opens_ends_the_episode_and_an_old_state_is_none(page: Page) -> None:
    page.send(axes=LET_GO)  # of the episode before
    driver = driver_of(page, Keyboard())
    with pytest.raises(DriverError, match="nobody has begun to drive"):
        driver.start(Seen())  # type: ignore[arg-type]
    assert sum(page.pauses) == pytest.approx(PATIENCE_S, abs=0.1)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"sender": 1}', '{"sender":"a","sequence":"x"}'])
def test_a_file_that_is_no_state_is_no_page(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text)
    assert read_state(str(tmp_path / "a.json")) is None
    assert read_state(str(tmp_path / "none.json")) is None
