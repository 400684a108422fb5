"""A class of the user's is found in its folders; what goes wrong in it is told: what and where."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import carla
import pytest

from carstage.collector.drivers import Driver
from carstage.collector.drivers.driving import command_of
from carstage.collector.drivers.loading import blamed, load_driver
from carstage.collector.drivers.replay import control_of
from carstage.collector.internals.errors import DriverError
from carstage.spec import ClassDriverSpec, Command

CODE = """
import helper_of_mine
from carstage.collector.drivers import Driver

class Mine(Driver):
    def __init__(self, gain=1.0, fails=False):
        self.gain = helper_of_mine.double(gain)
        if fails:
            self.fail()

    def fail(self):
        raise ZeroDivisionError("gain\\nof none")  # line 13

class Other:
    pass
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "mine_to_drive.py").write_text(CODE)
    (tmp_path / "helper_of_mine.py").write_text("def double(value): return 2.0 * value\n")
    (tmp_path / "lacking.py").write_text("import surely_not_there\n")
    (tmp_path / "torn.py").write_text("x = 1\ndef (:\n")
    yield str(tmp_path)
    for name in ("mine_to_drive", "helper_of_mine", "lacking", "torn"):
        sys.modules.pop(name, None)


def load(name: str, folder: str, **parameters: Any) -> Driver:
    return load_driver(ClassDriverSpec(name, parameters), [folder])


def test_a_class_is_made_with_its_parameters(folder: str) -> None:
    driver: Any = load("mine_to_drive:Mine", folder, gain=1.5)
    assert driver.gain == 3.0
    assert isinstance(driver, Driver)


@pytest.mark.parametrize(
    ("name", "parameters", "parts"),
    [
        ("not_here:Mine", {}, ["no module not_here", sys.executable]),
        ("not_here.below:Mine", {}, ["no module not_here"]),
        ("mine_to_drive:Gone", {}, ["mine_to_drive.py has no Gone"]),
        ("mine_to_drive:Other", {}, ["mine_to_drive:Other is no driver"]),
        ("lacking:Mine", {}, ["ModuleNotFoundError", "surely_not_there", "lacking.py, line 1"]),
        ("torn:Mine", {}, ["SyntaxError", "torn.py, line 2"]),
        (
            "mine_to_drive:Mine",
            {"fails": True},
            ["raised ZeroDivisionError: gain of none when it was made", "line 12, fail"],
        ),
        ("mine_to_drive:Mine", {"speed": 3}, ["TypeError", "speed", "in its call"]),
    ],
)
def test_what_goes_wrong_is_told(
    folder: str, name: str, parameters: dict[str, Any], parts: list[str]
) -> None:
    with pytest.raises(DriverError) as caught:
        load(name, folder, **parameters)
    assert caught.value.message.startswith("ego.driver: ")
    for part in parts:
        assert part in caught.value.message
    assert caught.value.hint


def test_the_folders_that_were_looked_in_are_named(folder: str) -> None:
    with pytest.raises(DriverError) as caught:
        load("not_here:Mine", folder)
    assert folder in caught.value.hint


def test_a_server_that_does_not_answer_is_not_the_drivers_fault() -> None:
    slow = RuntimeError("time-out of 2000ms while waiting for the simulator")
    with pytest.raises(RuntimeError, match="time-out"), blamed("mine:Mine", "ahead of step 3"):
        raise slow
    ended = pytest.raises(DriverError, match="SystemExit: 3 ahead of step 3")
    with ended, blamed("mine:Mine", "ahead of step 3"):
        sys.exit(3)


def test_a_command_is_the_control_to_the_bit() -> None:
    control = carla.VehicleControl(0.1, -0.3, 0.7, True, False, True, 3)
    command = command_of(control)
    assert command == Command(control.throttle, control.steer, control.brake, 1, 0, 1, 3)
    assert command_of(control_of(command)) == command
    assert command.throttle != 0.1, "a float of the wire has 24 bits"


@pytest.mark.parametrize(
    ("name", "value"), [("throttle", 1.5), ("steer", -1.01), ("brake", float("nan"))]
)
def test_a_control_out_of_range_is_refused(name: str, value: float) -> None:
    control = carla.VehicleControl()
    setattr(control, name, value)
    with pytest.raises(ValueError, match=name):
        command_of(control)
