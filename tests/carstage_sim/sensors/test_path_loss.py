"""Path loss against the standard's figures and hand-made sums."""

from __future__ import annotations

import math

import pytest

from carstage_sim.sensors import SensorAttributeError
from carstage_sim.sensors.path_loss import (
    Edge,
    PathState,
    RadioPath,
    RadioSettings,
    path_loss_db,
)


def radio(**attributes: object) -> RadioSettings:
    return RadioSettings.read({name: str(value) for name, value in attributes.items()})


def path(distance_m: float = 100.0, state: PathState = PathState.LINE_OF_SIGHT, *edges: Edge):
    return RadioPath(distance_m, 1.5, 1.5, state, edges)


def test_the_defaults_are_carlas() -> None:
    settings = radio()
    assert (settings.transmit_power, settings.receiver_sensitivity) == (21.5, -99.0)
    assert (settings.scenario, settings.path_loss_model) == ("highway", "winner")
    assert settings.wavelength_m == pytest.approx(0.0508, abs=1e-4)


@pytest.mark.parametrize(
    ("scenario", "state", "expected_db"),
    [
        ("highway", PathState.LINE_OF_SIGHT, 32.4 + 40.0 + 20.0 * math.log10(5.9)),
        ("urban", PathState.LINE_OF_SIGHT, 38.77 + 33.4 + 18.2 * math.log10(5.9)),
        ("rural", PathState.LINE_OF_SIGHT, 38.77 + 33.4 + 18.2 * math.log10(5.9)),
        ("urban", PathState.BUILDINGS, 36.85 + 60.0 + 18.9 * math.log10(5.9)),
    ],
)
def test_winner_losses_are_the_standards(scenario, state, expected_db) -> None:
    assert path_loss_db(path(100.0, state), radio(scenario=scenario)) == pytest.approx(expected_db)


def test_a_vehicle_in_between_takes_a_knife_edge_more() -> None:
    free = path_loss_db(path(), radio())
    low, high = (
        path_loss_db(path(100.0, PathState.VEHICLES, Edge(50.0, 50.0, height_m)), radio())
        for height_m in (0.0, 1.5)
    )
    # An edge on the line takes 6 dB; v = 1.5 m of it is 1.88 and takes 18.8 dB.
    assert low - free == pytest.approx(6.02, abs=0.1)
    assert high - free == pytest.approx(18.8, abs=0.3)


def test_of_several_vehicles_the_worst_counts() -> None:
    one = path(100.0, PathState.VEHICLES, Edge(50.0, 50.0, 2.0))
    two = path(100.0, PathState.VEHICLES, Edge(50.0, 50.0, 2.0), Edge(20.0, 80.0, 0.1))
    assert path_loss_db(one, radio()) == path_loss_db(two, radio())


def test_two_rays_far_away_lose_forty_db_a_decade() -> None:
    geometric = radio(path_loss_model="geometric")
    near, far = (path_loss_db(path(metres), geometric) for metres in (20_000.0, 200_000.0))
    assert far - near == pytest.approx(40.0, abs=1.0)


def test_behind_buildings_the_log_distance_model_holds() -> None:
    geometric = radio(path_loss_model="geometric", path_loss_exponent=3.0, d_ref=2.0)
    reference_db = 20.0 * math.log10(4.0 * math.pi * 2.0 / geometric.wavelength_m)
    loss_db = path_loss_db(path(200.0, PathState.BUILDINGS), geometric)
    assert loss_db == pytest.approx(reference_db + 60.0)


def test_antennas_above_each_other_are_in_free_space() -> None:
    above = RadioPath(10.0, 1.0, 11.0, PathState.LINE_OF_SIGHT)
    assert math.isfinite(path_loss_db(above, radio(path_loss_model="geometric")))


def test_fading_is_the_standards_or_ones_own() -> None:
    assert radio(scenario="urban").fading_db(PathState.LINE_OF_SIGHT) == 5.2
    assert radio(scenario="highway").fading_db(PathState.BUILDINGS) == 6.8
    own = radio(use_etsi_fading="False", custom_fading_stddev=2.5)
    assert own.fading_db(PathState.VEHICLES) == 2.5


@pytest.mark.parametrize(
    ("name", "value"),
    [("frequency_ghz", 0), ("d_ref", -1), ("scenario", "moon"), ("path_loss_model", "none"),
     ("custom_fading_stddev", -1), ("transmit_power", "much"), ("transmit_power", 1e300),
     ("frequency_ghz", 1e300), ("frequency_ghz", 1e-320), ("path_loss_exponent", 1e300),
     ("filter_distance", 1e30)],
)  # fmt: skip
def test_impossible_values_are_refused(name, value) -> None:
    with pytest.raises(SensorAttributeError, match=name):
        radio(**{name: value})


@pytest.mark.parametrize("model", ["winner", "geometric"])
@pytest.mark.parametrize("state", PathState)
def test_losses_are_numbers_at_the_bounds_of_what_is_accepted(model, state) -> None:
    for frequency_ghz in (0.001, 1000.0):
        for metres in (0.01, 1e6):
            way = RadioPath(metres, 0.02, 0.02, state)
            settings = radio(path_loss_model=model, frequency_ghz=frequency_ghz)
            assert math.isfinite(path_loss_db(way, settings))
