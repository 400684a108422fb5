"""Keyboard, gamepad and wheel: events injected into SDL become commands."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import carla
import pytest

pygame = pytest.importorskip("pygame", reason="the extra drive is not installed")

from carstage.collector.drivers.base import Observation  # noqa: E402
from carstage.collector.drivers.devices import device_driver, take_event  # noqa: E402
from carstage.collector.drivers.driving import command_of  # noqa: E402
from carstage.collector.drivers.inputs import Gamepad, Inputs, Keyboard, Wheel  # noqa: E402
from carstage.collector.internals.errors import DriverError  # noqa: E402
from carstage.config.drivers import GamepadDriver, WheelDriver  # noqa: E402
from carstage.spec import Command, DeviceDriverSpec  # noqa: E402

STEP_S = 0.05


@pytest.fixture(autouse=True)
def sdl(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.display.init()
    yield
    pygame.quit()


def post(kind: int, **fields: Any) -> None:
    pygame.event.post(pygame.event.Event(kind, **fields))


def command(inputs: Inputs, gear: int = 1) -> Command:
    for event in pygame.event.get():
        take_event(inputs, event)
    return inputs.command(STEP_S, gear)


def numbers(section: Any) -> dict[str, int]:
    return {name: getattr(section, name) for name in section.inputs}


def test_keys_hold_pedals_and_wheel_as_long_as_they_are_down() -> None:
    keys = Keyboard()
    post(pygame.KEYDOWN, key=pygame.K_w)
    post(pygame.KEYDOWN, key=pygame.K_LEFT)
    first, second = command(keys), command(keys)
    assert (first.throttle, second.throttle) == pytest.approx((0.1, 0.2))
    for _ in range(6):
        last = command(keys)
    assert last.steer == pytest.approx(-0.2)  # 0.5 per second for 0.4 s, in tenths
    assert last.brake == 0.0
    post(pygame.KEYUP, key=pygame.K_w)
    post(pygame.KEYUP, key=pygame.K_LEFT)
    post(pygame.KEYDOWN, key=pygame.K_s)
    post(pygame.KEYDOWN, key=pygame.K_SPACE)
    now = command(keys)
    assert (now.throttle, now.steer, now.brake, now.hand_brake) == (0.0, 0.0, 0.2, 1)


def test_keys_change_direction_and_gears() -> None:
    keys = Keyboard()
    post(pygame.KEYDOWN, key=pygame.K_q)
    assert command(keys)[4:] == (1, 0, -1)
    post(pygame.KEYDOWN, key=pygame.K_q)
    assert command(keys)[4:] == (0, 0, 1)
    post(pygame.KEYDOWN, key=pygame.K_PERIOD)
    assert command(keys)[4:] == (0, 0, 1), "the gear box shifts by itself"
    post(pygame.KEYDOWN, key=pygame.K_m)
    assert command(keys, gear=2)[4:] == (0, 1, 2)
    post(pygame.KEYDOWN, key=pygame.K_PERIOD)
    assert command(keys)[4:] == (0, 1, 3)
    for _ in range(9):
        post(pygame.KEYDOWN, key=pygame.K_COMMA)
    assert command(keys)[4:] == (1, 1, -1)


def test_a_gamepad_steers_by_stick_and_triggers() -> None:
    pad = Gamepad(numbers(GamepadDriver(kind="gamepad")))
    assert command(pad) == Command(0.0, 0.0, 0.0, 0, 0, 0, 1), "at rest before the first event"
    post(pygame.JOYAXISMOTION, axis=0, value=-0.5, instance_id=0)
    post(pygame.JOYAXISMOTION, axis=5, value=0.0, instance_id=0)
    post(pygame.JOYAXISMOTION, axis=2, value=-1.0, instance_id=0)
    post(pygame.JOYAXISMOTION, axis=1, value=1.0, instance_id=0)  # nothing is on it
    assert command(pad) == Command(0.5, -0.5, 0.0, 0, 0, 0, 1)
    post(pygame.JOYAXISMOTION, axis=0, value=0.03, instance_id=0)
    post(pygame.JOYBUTTONDOWN, button=0, instance_id=0)
    post(pygame.JOYBUTTONDOWN, button=1, instance_id=0)
    post(pygame.JOYBUTTONUP, button=1, instance_id=0)
    assert command(pad) == Command(0.5, 0.0, 0.0, 1, 1, 0, -1)
    post(pygame.JOYBUTTONUP, button=0, instance_id=0)
    assert command(pad).hand_brake == 0


def test_a_wheel_has_the_curves_of_carlas_own_client() -> None:
    wheel = Wheel(numbers(WheelDriver(kind="wheel")))
    post(pygame.JOYAXISMOTION, axis=0, value=0.4, instance_id=0)
    post(pygame.JOYAXISMOTION, axis=2, value=-1.0, instance_id=0)
    post(pygame.JOYAXISMOTION, axis=3, value=1.0, instance_id=0)
    pressed = command(wheel)
    assert pressed.steer == pytest.approx(math.tan(0.44))
    assert pressed.throttle == 1.0
    assert pressed.brake == pytest.approx(0.0, abs=0.05)
    post(pygame.JOYAXISMOTION, axis=0, value=-1.0, instance_id=0)
    assert command(wheel).steer == -1.0


class Picture:
    """A ``carla.Image`` of one colour."""

    width, height = 32, 18
    raw_data = bytes([10, 20, 200, 255]) * (32 * 18)


class Ego:
    """A ``carla.Vehicle`` that says its gear."""

    def get_control(self) -> Any:
        return carla.VehicleControl(gear=2)


def observation(tick: int, **data: Any) -> Observation:
    here, still, control = carla.Transform(), carla.Vector3D(), carla.VehicleControl()
    ego: Any = Ego()
    return Observation(
        tick, tick + 9, 0.1 * tick, STEP_S, here, still, 30.0, control, (), ego, None, None, data
    )


def test_the_window_shows_the_camera_and_drives_in_real_time() -> None:
    driver = device_driver(DeviceDriverSpec("keyboard", "CAM"), STEP_S)
    assert list(driver.sensors) == ["CAM"]
    driver.start(observation(0))
    begin_ms = pygame.time.get_ticks()
    post(pygame.KEYDOWN, key=pygame.K_UP)
    for tick in range(5):
        control = driver.drive(observation(tick, CAM=Picture()))
    assert pygame.time.get_ticks() - begin_ms >= 4 * 1000 * STEP_S - 5
    assert command_of(control).throttle == pytest.approx(0.5)
    window = pygame.display.get_surface()
    assert window.get_size() == (32, 18)
    assert tuple(window.get_at((5, 5)))[:3] == (200, 20, 10)
    driver.stop()


@pytest.mark.parametrize("event", ["QUIT", "KEYUP"])
def test_a_closed_window_gives_the_episode_up(event: str) -> None:
    driver = device_driver(DeviceDriverSpec("keyboard", "CAM"), STEP_S)
    driver.start(observation(0))
    post(getattr(pygame, event), **({"key": pygame.K_ESCAPE} if event == "KEYUP" else {}))
    with pytest.raises(DriverError, match="closed ahead of step 3"):
        driver.drive(observation(3))
    driver.stop()


def test_a_device_that_is_not_connected_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pygame.joystick, "get_count", lambda: 0)
    inputs = numbers(GamepadDriver(kind="gamepad"))
    driver = device_driver(DeviceDriverSpec("gamepad", "CAM", inputs=inputs), STEP_S)
    with pytest.raises(DriverError, match="no gamepad or steering wheel"):
        driver.start(observation(0))
