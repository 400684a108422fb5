"""The speed that the Traffic Manager is told to desire moves a car as is wished."""

from __future__ import annotations

import itertools

import pytest

from carstage.collector.comfort.pedals import Pedals, Sign
from carstage.collector.comfort.wishes import (
    HELD_M_S,
    STANDING_GAP_M,
    on_free_road,
    to_be_slower,
    to_follow,
)
from carstage.spec import ComfortSpec

COMFORT = ComfortSpec()


class Car:
    """A car under the Traffic Manager's controller, as LibCarla has it.

    Args:
        step_s: of a step.
        told: what the server tells as the speed: that at the ``end`` of a step, or the ``mean``.
    """

    def __init__(self, step_s: float, told: str = "end") -> None:
        self.step_s, self.told = step_s, told
        self.speed = self.seen = self.error = self.pedal = self.acted = 0.0
        self.throttle = self.brake = 0.0
        self.way_m = 0.0
        self.holds = False

    def command(self, desired: float) -> None:
        """The Traffic Manager answers at the end of a step, to what the server tells."""
        error = (desired - self.seen) / desired
        change = (error - self.error) / 0.05
        pedal = 12.0 * error + 0.05 * (error + self.error) * 0.05 + 0.02 * change
        self.pedal = -1.0 if self.holds else min(max(pedal, -0.7), 0.85)
        self.error = error

    def step(self) -> None:
        before, parts = self.way_m, 20
        self.acted = self.pedal
        for _ in range(parts):
            part_s = self.step_s / parts
            self.throttle = moved(self.throttle, max(self.pedal, 0.0), part_s)
            self.brake = moved(self.brake, max(-self.pedal, 0.0), part_s)
            drag = 0.2 if self.speed > 0.0 else 0.0
            change = (4.4 * self.throttle - 9.0 * self.brake - drag) * part_s
            self.speed = max(self.speed + change, 0.0)
            self.way_m += self.speed * part_s
        mean = (self.way_m - before) / self.step_s
        self.seen = self.speed if self.told == "end" else mean


def moved(place: float, to: float, time_s: float) -> float:
    return min(to, place + 6.0 * time_s) if to > place else max(to, place - 10.0 * time_s)


def drive(car: Car, pedals: Pedals, wish: float, seconds: float) -> list[float]:
    """Speeds at the ends of the steps, while an acceleration is wished for."""
    speeds = []
    for _ in range(round(seconds / car.step_s)):
        desired = pedals.desired_m_s(car.seen, wish, car.acted, ())
        car.step()  # with what was answered before
        car.command(desired)
        speeds.append(car.speed)
    return speeds


@pytest.mark.parametrize("told", ["end", "mean"])
@pytest.mark.parametrize("fps", [10, 20, 30])
def test_a_car_accelerates_and_brakes_as_is_wished(fps: int, told: str) -> None:
    car = Car(1.0 / fps, told)
    pedals = Pedals(COMFORT, car.step_s)
    faster = drive(car, pedals, 1.5, 6.0)
    assert (faster[-1] - faster[-2 * fps - 1]) / 2.0 == pytest.approx(1.5, abs=0.15)
    slower = drive(car, pedals, -1.5, 4.0)
    assert (slower[-1] - slower[-2 * fps - 1]) / 2.0 == pytest.approx(-1.5, abs=0.15)


@pytest.mark.parametrize("fps", [10, 20])
def test_changes_of_the_acceleration_are_soft_once_it_drives(fps: int) -> None:
    car = Car(1.0 / fps)
    pedals = Pedals(COMFORT, car.step_s)
    drive(car, pedals, 1.5, 4.0)
    speeds = [car.speed, *drive(car, pedals, -1.5, 3.0)]
    felt = [(b - a) * fps for a, b in itertools.pairwise(speeds)]
    jerks = [abs(b - a) * fps for a, b in itertools.pairwise(felt)]
    assert (sum(jerk * jerk for jerk in jerks) / len(jerks)) ** 0.5 < COMFORT.jerk_m_s3 + 0.5


def test_a_car_that_the_traffic_manager_holds_starts_when_it_is_let_go() -> None:
    car = Car(0.1)
    pedals = Pedals(COMFORT, car.step_s)
    car.holds = True
    assert drive(car, pedals, 1.8, 3.0)[-1] == 0.0
    car.holds = False
    speeds = drive(car, pedals, 1.8, 3.0)
    assert speeds[-1] == pytest.approx(1.8 * 3.0, abs=1.0)
    assert all(after >= before - 0.1 for before, after in itertools.pairwise(speeds))


def test_nothing_asks_for_a_speed_of_zero() -> None:
    car = Car(0.1)
    pedals = Pedals(COMFORT, car.step_s)
    for wish in (-3.0, 0.0, -1.0):
        for _ in range(20):
            assert pedals.desired_m_s(0.0, wish, car.acted, ()) > 0.0


@pytest.mark.parametrize(("distance_m", "wanted"), [(40.0, 9.0), (20.0, 7.0), (10.0, 5.0)])
def test_a_sign_is_asked_away(distance_m: float, wanted: float) -> None:
    sign = Sign(distance_m, 15.0 / 3.6)
    asked = sign.raised(wanted)
    assert asked >= wanted
    assert sign.lowered(asked) == pytest.approx(wanted, rel=1e-6)


def past_a_sign(heeds: bool, there_is_one: bool = True) -> list[float]:
    """Speeds while a car slows down towards a sign, and the speed that is asked for at the end."""
    car = Car(0.1)
    pedals = Pedals(COMFORT, car.step_s)
    drive(car, pedals, 1.5, 4.0)
    at_m, speeds = car.way_m + 20.0, []
    while car.way_m < at_m - 9.0:
        sign = Sign(at_m - car.way_m, 15.0 / 3.6)
        signs = [sign] if there_is_one else []
        asked = pedals.desired_m_s(car.seen, -0.8, car.acted, signs)
        car.step()
        nearer = Sign(at_m - car.way_m, sign.speed_m_s)
        car.command(nearer.lowered(asked) if heeds and there_is_one else asked)
        speeds.append(car.speed)
    return [*speeds, asked]


def test_a_sign_does_not_change_how_one_slows_down() -> None:
    *with_sign, asked = past_a_sign(heeds=True)
    *without, _ = past_a_sign(heeds=True, there_is_one=False)
    assert asked > with_sign[-1] + 1.0
    assert with_sign == pytest.approx(without, abs=0.3)


def test_a_traffic_manager_that_heeds_no_signs_is_found_out() -> None:
    *speeds, asked = past_a_sign(heeds=False)
    assert asked < speeds[-1] + 0.5
    assert max(speeds) < speeds[0] + 1.5


def test_a_sign_that_allows_less_is_not_asked_away() -> None:
    sign = Sign(3.0, 15.0 / 3.6)
    assert sign.lowered(sign.raised(12.0)) < 5.5


def test_a_wish_for_a_slower_place_brings_one_there_in_time() -> None:
    speed, left_m, least = 12.0, 60.0, 0.0
    while left_m > 0.0:
        wish = min(to_be_slower(COMFORT, speed, 4.0, left_m), 0.0)
        least = min(least, wish)
        speed += 0.05 * wish
        left_m -= 0.05 * speed
    assert speed == pytest.approx(4.0, abs=0.4)
    assert least > -1.1 * COMFORT.acceleration_m_s2


def test_one_drives_at_the_limit_and_not_faster() -> None:
    assert on_free_road(COMFORT, 5.0, 13.9) == COMFORT.acceleration_m_s2
    assert on_free_road(COMFORT, 13.9, 13.9) == 0.0
    assert on_free_road(COMFORT, 15.0, 13.9) < 0.0


def test_one_keeps_a_gap_and_comes_to_a_stand_behind_who_stands() -> None:
    assert to_follow(COMFORT, 10.0, 10.0, 200.0) == pytest.approx(1.8, abs=0.05)
    assert to_follow(COMFORT, 10.0, 10.0, STANDING_GAP_M + 16.0) == pytest.approx(0.0, abs=1e-9)
    assert to_follow(COMFORT, 10.0, 0.0, 40.0) < -0.5
    speed, gap_m, hardest = 12.0, 100.0, 0.0
    while speed > HELD_M_S:
        wish = to_follow(COMFORT, speed, 0.0, gap_m)
        hardest = min(hardest, wish)
        speed += 0.05 * wish
        gap_m -= 0.05 * speed
    assert gap_m == pytest.approx(STANDING_GAP_M, abs=1.5)
    assert hardest > -2.0 * COMFORT.acceleration_m_s2
