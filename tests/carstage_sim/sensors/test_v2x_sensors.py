"""V2X sensors: what is received, how strongly, and what messages say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.cam import CAM_DATA, CUSTOM_DATA, CamNoise, cam_message
from carstage_sim.sensors.projection import GeoProjection
from carstage_sim.world.transmissions import StationType, Transmission
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

OWN, OTHER, BETWEEN = 3, 4, 5
QUIET = {"use_etsi_fading": "false"}


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    cache = tmp_path_factory.mktemp("trees")
    with WorldSensors(town(GROUND, WALL), threads=1, cache=cache) as built:
        yield built


def sending(location=(0.0, 0.0, 0.0), **changes) -> Transmission:
    return replace(
        Transmission(
            sensor_id=50, type_id="sensor.other.v2x", attributes={}, station_id=OTHER,
            station_type=StationType.PASSENGER_CAR, frame=1, timestamp_s=0.1, location=location,
            rotation_deg=(0.0, 0.0, 0.0), antenna=location, velocity=(0.0, 0.0, 0.0),
            acceleration=(0.0, 0.0, 0.0), angular_velocity_deg=(0.0, 0.0, 0.0),
            half_size=(2.4, 1.05, 0.75), light_state=0, low_frequency=False,
        ),
        **changes,
    )  # fmt: skip


def received(sensors, own, other, *, also=(), kind="other.v2x", changes=None, **attributes):
    """Messages that a car hears from another one."""
    sensors.reset()
    cars = [(OWN, own, 0.0), (OTHER, other, 0.0), *also]
    world = replace(state(1, vehicles=cars), transmissions=(sending(other, **(changes or {})),))
    asked = request(kind, owner_id=OWN, location=own, **(QUIET | attributes))
    return [frame.messages for _, frame in sensors.capture(world, [asked])]


def test_the_power_is_that_of_the_free_way(sensors) -> None:
    ((message,),) = received(sensors, (-100.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    # 21.5 dBm + 10 dBi - (32.4 + 20 log 100 + 20 log 5.9) dB
    assert message["power"] == pytest.approx(31.5 - 87.82, abs=0.02)
    assert message["header"]["station_id"] == OTHER


def test_who_sends_stronger_is_heard_stronger(sensors) -> None:
    for dbm in (10.0, 30.0):
        ((message,),) = received(
            sensors, (-100.0, 0.0, 0.0), (0.0, 0.0, 0.0),
            changes={"attributes": {"transmit_power": str(dbm)}},
        )  # fmt: skip
        assert message["power"] == pytest.approx(dbm + 10.0 - 87.82, abs=0.02)


def test_a_wall_takes_power(sensors) -> None:
    ((free,),) = received(sensors, (-25.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    ((walled,),) = received(sensors, (-10.0, 0.0, 0.0), (20.0, 0.0, 0.0))
    assert free["power"] - walled["power"] == pytest.approx(18.37, abs=0.1)


def test_a_car_in_between_takes_power_and_one_beside_does_not(sensors) -> None:
    own, other = (-60.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    ((free,),) = received(sensors, own, other)
    ((beside,),) = received(sensors, own, other, also=[(BETWEEN, (-30.0, 5.0, 0.0), 0.0)])
    ((hidden,),) = received(sensors, own, other, also=[(BETWEEN, (-30.0, 0.0, 0.8), 0.0)])
    assert beside["power"] == free["power"]
    assert 6.0 < free["power"] - hidden["power"] < 35.0


def test_what_is_too_weak_or_too_far_is_not_heard(sensors) -> None:
    own, other = (-100.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    assert received(sensors, own, other, receiver_sensitivity=-50) == []
    assert received(sensors, own, other, filter_distance=99) == []


def test_nobody_hears_itself_nor_the_other_kind_of_message(sensors) -> None:
    own, other = (-10.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    assert received(sensors, own, other, changes={"station_id": OWN}) == []
    assert received(sensors, own, other, kind="other.v2x_custom") == []


def test_fading_is_the_same_for_the_same_seed(sensors) -> None:
    own, other = (-100.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    drawn = [
        received(sensors, own, other, noise_seed=seed, use_etsi_fading="true")[0]["power"][0]
        for seed in (1, 1, 2)
    ]
    assert drawn[0] == drawn[1] != drawn[2]


def test_fading_scatters_as_the_standard_says(sensors) -> None:
    own, other = (-100.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    powers = [
        received(sensors, own, other, noise_seed=seed, use_etsi_fading="true")[0]["power"][0]
        for seed in range(1, 101)
    ]
    assert np.std(powers) == pytest.approx(3.3, abs=0.8)
    assert np.mean(powers) == pytest.approx(31.5 - 87.82, abs=1.2)


def test_a_text_arrives_as_it_was_sent(sensors) -> None:
    changes = {"type_id": "sensor.other.v2x_custom", "text": "Glätte"}
    ((message,),) = received(
        sensors, (-10.0, 0.0, 0.0), (0.0, 0.0, 0.0), kind="other.v2x_custom", changes=changes
    )
    assert message["text"].decode() == "Glätte"
    assert message["header"]["message_id"] == 0


def test_messages_of_ticks_without_a_turn_come_later(sensors) -> None:
    sensors.reset()
    cars = [(OWN, (-10.0, 0.0, 0.0), 0.0), (OTHER, (0.0, 0.0, 0.0), 0.0)]
    asked = request("other.v2x", owner_id=OWN, sensor_tick=0.3, **QUIET)
    heard = []
    for frame in range(1, 5):
        world = state(frame, vehicles=cars)
        if frame in (2, 3):
            world = replace(world, transmissions=(sending(frame=frame, timestamp_s=frame / 10),))
        frames = sensors.capture(world, [asked])
        heard.append([m["generation_delta_time"] for _, f in frames for m in f.messages])
    assert heard == [[], [], [], [200, 300]]


def message(**changes):
    (made,) = cam_message(sending(**changes), -50.0, (49.0, 8.0), GeoProjection.TRANSVERSE_MERCATOR)
    return made


def test_the_layout_is_the_clients() -> None:
    assert CAM_DATA.itemsize == 464
    assert CUSTOM_DATA.itemsize == 136
    assert CAM_DATA.fields["high_frequency"][1] == 8 + 24 + 8 + 64
    assert CAM_DATA.fields["low_frequency"][1] == 464 - 56


def test_a_message_has_the_motion_of_its_station() -> None:
    told = message(
        timestamp_s=70.0, rotation_deg=(0.0, 90.0, 0.0), velocity=(0.0, 12.345, 0.0),
        acceleration=(0.0, -2.0, 0.0), angular_velocity_deg=(0.0, 0.0, 3.0),
    )  # fmt: skip
    assert told["generation_delta_time"] == 70_000 - 65_536
    assert told["latitude"] == 490_000_000
    assert told["longitude"] == 80_000_000
    assert told["heading"]["value"] == 1800  # south: +y in CARLA's frame
    assert told["speed"]["value"] == 1234 or told["speed"]["value"] == 1235
    assert told["drive_direction"] == 0
    assert told["longitudinal_acceleration"]["value"] == -20
    assert told["vertical_acceleration"]["value"] == 98
    assert told["yaw_rate"]["value"] == 300
    assert (told["vehicle_length"]["value"], told["vehicle_width"]) == (48, 21)


def test_who_drives_backwards_says_so() -> None:
    told = message(velocity=(-3.0, 0.0, 0.0))
    assert (told["drive_direction"], told["speed"]["value"]) == (1, 0)


def test_lights_and_role_are_of_the_low_frequency_container() -> None:
    bare = message(light_state=2)
    assert (bare["low_frequency"], bare["exterior_lights"]) == (0, 0)
    told = message(light_state=2 | 32, low_frequency=True, station_type=StationType.SPECIAL_VEHICLE)
    assert (told["low_frequency"], told["vehicle_role"]) == (1, 6)
    assert told["exterior_lights"] == 0b1010_0000


@pytest.mark.parametrize(
    ("kind", "container"), [(StationType.ROADSIDE_UNIT, 2), (StationType.PEDESTRIAN, 0)]
)
def test_who_is_no_vehicle_says_where_it_is(kind, container) -> None:
    told = message(station_type=kind, low_frequency=True)
    assert (told["high_frequency"], told["low_frequency"]) == (container, 0)
    assert told["latitude"] == 490_000_000


def test_noise_is_added_as_the_attributes_say() -> None:
    attributes = {"noise_lat_bias": "0.001", "noise_head_bias": "10", "noise_seed": "3"}
    told = message(attributes=attributes)
    assert told["latitude"] == 490_010_000
    assert told["heading"]["value"] == 1000
    shaken = attributes | {"noise_vel_stddev_x": "1.0"}
    first, second = (
        message(attributes=shaken, frame=frame, velocity=(20.0, 0.0, 0.0)) for frame in (1, 2)
    )
    assert first["speed"]["value"] != second["speed"]["value"]
    assert first == message(attributes=shaken, frame=1, velocity=(20.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("name", "value"),
    [("noise_lat_bias", 1e15), ("noise_alt_bias", -1e300), ("noise_head_bias", 1e308),
     ("noise_yawrate_stddev", 1e308), ("noise_lon_stddev", -1)],
)  # fmt: skip
def test_noise_that_no_message_can_hold_is_refused(name, value) -> None:
    with pytest.raises(SensorAttributeError, match=name):
        CamNoise({name: str(value)})


def test_the_greatest_noise_fits_a_message() -> None:
    names = [f"noise_{name}_bias" for name in ("lat", "lon", "alt", "head", "yawrate")]
    names += [f"noise_accel_stddev_{axis}" for axis in "xyz"]
    told = message(attributes=dict.fromkeys(names, "1e6"))
    assert told["latitude"] == 490_000_000 + 10**13
    assert told["yaw_rate"]["value"] == 32_767  # not known
