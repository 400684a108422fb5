"""The event camera: thresholds, times, refractory period, and what a real picture gives."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.dvs import DvsCamera
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

STEP_NS = 100_000_000


class Pictures:
    """Stands for a view: gives one picture after the other."""

    def __init__(self, *greys: list[float]) -> None:
        self._greys = iter(greys)

    def colours(self, _camera, _film):
        grey = np.array([next(self._greys)], np.uint8)
        return np.repeat(grey[..., None], 3, axis=2)


def events_of(*greys: list[float], **attributes):
    """Events of each picture after the first, as a list of (x, t in ns, polarity)."""
    sensor = request("camera.dvs", **(
        {"image_size_x": len(greys[0]), "image_size_y": 1, "use_log": "False"} | attributes
    ))  # fmt: skip
    camera, view, frames = DvsCamera(sensor, town(GROUND)), Pictures(*greys), []
    for number in range(len(greys)):
        frame = camera.measure(state(1 + number), sensor, view)
        frames.append([] if frame is None else [
            (int(e["x"]), int(e["t"]), int(e["pol"])) for e in frame.events
        ])  # fmt: skip
    assert frames[0] == []
    return frames[1:]


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL), threads=1, cache=tmp_path_factory.mktemp("trees")
    ) as built:
        yield built


def near(time_ns):
    # 8-bit greys are weighted with factors that add up to 0.9999.
    return pytest.approx(time_ns, abs=20_000)


def test_each_threshold_crossed_is_an_event_at_its_time():
    # From 100 to 135 the levels 110, 120 and 130 are passed.
    (found,) = events_of([100, 50], [135, 50], positive_threshold=10)
    assert [(x, polarity) for x, _, polarity in found] == [(0, 1)] * 3
    for (_, time_ns, _), share in zip(found, (10 / 35, 20 / 35, 30 / 35), strict=True):
        assert time_ns == near(STEP_NS + share * STEP_NS)


def test_darker_uses_its_own_threshold():
    (found,) = events_of([100], [85], positive_threshold=1, negative_threshold=10)
    assert [(x, polarity) for x, _, polarity in found] == [(0, 0)]


def test_small_changes_add_up_until_the_threshold():
    frames = events_of([100], [104], [108], [112], [116], positive_threshold=10)
    assert [len(events) for events in frames] == [0, 0, 1, 0]


def test_the_level_stays_where_the_last_event_was():
    frames = events_of([100], [115], [104], [99], positive_threshold=10, negative_threshold=10)
    # The level is 110 after the first: 104 is not ten below it, 99 is.
    assert [[polarity for *_, polarity in events] for events in frames] == [[1], [], [0]]


def test_events_are_in_the_order_of_their_times():
    (found,) = events_of([100, 100], [120, 140], positive_threshold=15)
    times = [time_ns for _, time_ns, _ in found]
    assert times == sorted(times)
    assert [x for x, *_ in found] == [1, 0, 1]


def test_a_pixel_rests_for_its_refractory_period():
    options = {"positive_threshold": 10, "refractory_period_ns": int(0.6 * STEP_NS)}
    (found,) = events_of([100], [135], **options)
    assert len(found) == 1
    assert found[0][1] == near(STEP_NS + 10 / 35 * STEP_NS)


def test_brightness_is_logarithmic_unless_told_otherwise():
    # log(0.001 + 0.4) - log(0.001 + 0.2) is 0.69: two steps of 0.3.
    (found,) = events_of([51], [102], use_log="true")
    assert len(found) == 2


def test_a_noisy_threshold_repeats_itself_and_never_sticks():
    greys = [[100 + 7 * k] * 64 for k in range(12)]
    noisy = {"positive_threshold": 10, "sigma_positive_threshold": 3}
    first, second = events_of(*greys, **noisy), events_of(*greys, **noisy)
    assert first == second
    counts = np.bincount([x for events in first for x, *_ in events], minlength=64)
    assert counts.min() >= 4
    assert len(set(counts.tolist())) > 1


def test_what_moves_gives_events_and_what_stands_gives_none(sensors):
    sensors.reset()
    camera = request("camera.dvs", location=(0.0, 0.0, 1.0))
    sent = [
        sensors.capture(state(k, vehicles=[(3, (6.0, y, 0.0), 90.0)]), [camera])
        for k, y in enumerate((0.0, 0.5, 0.5), start=1)
    ]
    assert [len(frames) for frames in sent] == [0, 1, 0]
    events = sent[1][0][1].events
    assert len(events) > 20
    assert events["t"].min() > STEP_NS
    assert events["t"].max() <= 2 * STEP_NS
    assert events["x"].max() < 64
    assert events["y"].max() < 48
    assert {0, 1} == set(events["pol"].tolist())


def test_the_colour_camera_of_the_pose_shares_its_picture(sensors):
    sensors.reset()
    sensors.capture(state(1), [request("camera.dvs", 1), request("camera.rgb", 2)])
    assert sensors.last_cast_count == 1


@pytest.mark.parametrize(
    ("name", "value"), [("positive_threshold", 0), ("log_eps", 0), ("use_log", "maybe")]
)
def test_an_impossible_event_camera_is_refused_by_the_attributes_name(sensors, name, value):
    with pytest.raises(SensorAttributeError, match=name):
        sensors.capture(state(1), [request("camera.dvs", **{name: value})])
