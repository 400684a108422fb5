"""What clients change about the town is seen: objects, paint, lamps, debug shapes, open doors."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.sensors import WorldSensors
from carstage_sim.world.debug_shapes import DebugDrawing, arrow, box_edges
from carstage_sim.world.state import Weather
from carstage_sim.world.street_lights import INTENSITY
from carstage_sim.world.town_changes import TownChanges
from sensor_worlds import GROUND, WALL, box, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

_WALL_ID = 5
_LAMP_ID = 2
_LAMP = box(
    (4.8, -0.3, 4.9), (5.2, 0.3, 5.0), Material.STREET_LAMP, CityObjectLabel.POLES, _LAMP_ID
)
_NIGHT = Weather(sun_altitude_angle=-60.0)


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL, _LAMP), threads=1, cache=tmp_path_factory.mktemp("trees")
    ) as built:
        yield built


@pytest.fixture
def look(sensors):
    """Gives the picture of a camera, or another sensor's frame, in a world with changes."""
    sensors.reset()

    def capture(kind="camera.rgb", vehicles=(), weather=None, ignored=(), **changes):
        sensors.reset()
        world = replace(state(vehicles=list(vehicles), weather=weather), **changes)
        attributes = {"channels": 8, "points_per_second": 8000} if "lidar" in kind else {}
        asked = replace(request(kind, **attributes), ignored=frozenset(ignored))
        ((_, frame),) = sensors.capture(world, [asked])
        return frame.pixels[..., :3].astype(int) if kind.startswith("camera") else frame

    return capture


def test_a_hidden_object_is_gone_for_every_sensor_and_comes_back(look, sensors):
    hidden = TownChanges(hidden=frozenset({_WALL_ID}))
    tags = look("camera.semantic_segmentation", town_changes=TownChanges())[..., 2]
    without = look("camera.semantic_segmentation", town_changes=hidden)[..., 2]
    back = look("camera.semantic_segmentation", town_changes=TownChanges())[..., 2]
    assert (tags == CityObjectLabel.BUILDINGS).mean() > 0.1
    assert not (without == CityObjectLabel.BUILDINGS).any()
    assert (back == tags).all()
    through = sensors.segment_hits(
        replace(state(), town_changes=hidden), (0.0, 0.0, 2.0), (60.0, 0.0, 2.0)
    )
    assert through == []


@pytest.mark.parametrize("kind", ["camera.rgb", "camera.optical_flow"])
def test_a_picture_in_pieces_is_the_same_whatever_is_looked_at_in_between(sensors, kind):
    hidden = replace(
        state(vehicles=[(7, (7.0, 2.0, 0.0), 10.0)]),
        town_changes=TownChanges(hidden=frozenset({_WALL_ID})),
    )
    vehicles = [(3, (6.0, 0.0, 0.0), 30.0)]
    world = replace(state(vehicles=vehicles), town_changes=TownChanges())
    asked, others = [request(kind, 1)], [request("camera.rgb", 2)]
    between = []

    def look_elsewhere():
        between.extend(sensors.capture(hidden, others))

    def bytes_of(give_way=None):
        sensors.reset()
        with sensors.giving_way(world, give_way) if give_way else nullcontext():
            ((_, frame),) = sensors.capture(world, asked)
        return (frame.pixels if kind == "camera.rgb" else frame.flow).tobytes()

    alone = bytes_of()
    assert not between
    assert bytes_of(look_elsewhere) == alone
    assert len(between) > 10
    assert len({frame.pixels.tobytes() for _, frame in between}) == 1


def test_a_segment_meets_all_surfaces_in_order(sensors):
    hits = sensors.segment_hits(
        replace(state(), town_changes=TownChanges()), (0.0, 0.0, 2.0), (60.0, 0.0, 2.0)
    )
    assert [round(place[0], 3) for place, _ in hits] == [10.0, 11.0]
    assert {label for _, label in hits} == {CityObjectLabel.BUILDINGS}


def test_paint_and_glow_replace_the_look_of_one_object(look):
    plain = look(town_changes=TownChanges())
    red = look(town_changes=TownChanges(paint={_WALL_ID: (1.0, 0.0, 0.0)}))
    ground, wall = np.s_[40:, :], np.s_[5:20, 45:60]
    assert (red[ground] == plain[ground]).mean() > 0.95
    assert (red[wall][..., 2] > red[wall][..., 0] + 40).all()
    green = look(weather=_NIGHT, town_changes=TownChanges(glow={_WALL_ID: (0.0, 1.0, 0.0)}))
    assert (green[wall][..., 1] > 150).all()


def test_a_lamp_lights_the_ground_in_its_colour_while_it_is_on(look):
    def ground(power):
        lamp = TownChanges(lamp_power=np.array([power], np.float32))
        return look(weather=_NIGHT, town_changes=lamp)[36:44].mean(axis=(0, 1))

    off, white, red = ground((0, 0, 0)), ground((1, 1, 1)), ground((1, 0, 0))
    assert white.min() > off.max() + 10
    assert red[2] > red[0] + 10


def test_a_hidden_lamp_gives_no_light(look):
    power = np.ones((1, 3), np.float32)
    lit = look(weather=_NIGHT, town_changes=TownChanges(lamp_power=power))
    gone = look(
        weather=_NIGHT, town_changes=TownChanges(lamp_power=power, hidden=frozenset({_LAMP_ID}))
    )
    assert gone[36:44].mean() < lit[36:44].mean() - 5


def test_debug_lines_are_seen_by_colour_cameras_alone_and_hide_behind_walls(look):
    drawing = DebugDrawing()
    drawing.lines([((6.0, -1.0, 2.0), (6.0, 1.0, 2.0))], 0.6, (255, 0, 0), 0.0, 1.0)
    drawing.step(0.0)
    plain, drawn = look(), look(debug_shapes=drawing.frame)
    red = (drawn[..., 2] > 200) & (drawn[..., 1] < 60) & (drawn[..., 0] < 60)
    assert 6 <= red.sum() <= 60
    assert (plain[~red] == drawn[~red]).mean() > 0.98
    assert (look("camera.depth") == look("camera.depth", debug_shapes=drawing.frame)).all()
    drawing.clear()
    drawing.lines([((12.0, -1.0, 2.0), (12.0, 1.0, 2.0))], 0.6, (255, 0, 0), 0.0, 1.0)
    drawing.step(0.0)
    assert (look(debug_shapes=drawing.frame) == plain).all()


def test_an_event_camera_sees_a_debug_line_appear(sensors):
    drawing = DebugDrawing()
    drawing.lines([((6.0, -1.0, 2.0), (6.0, 1.0, 2.0))], 0.6, (255, 255, 255), 0.0, 1.0)
    drawing.step(0.0)
    sensors.reset()
    asked = [request("camera.dvs")]
    assert sensors.capture(state(1), asked) == []
    ((_, frame),) = sensors.capture(replace(state(2), debug_shapes=drawing.frame), asked)
    middle = (np.abs(frame.events["y"].astype(int) - 24) <= 4).mean()
    assert middle > 0.95


def test_a_point_has_its_size_in_pixels_at_any_distance(look):
    sizes = []
    for distance in (3.0, 9.0):
        drawing = DebugDrawing()
        drawing.point((distance, 0.0, 2.0), 6.0, (0, 0, 255), 0.0, -1.0)
        drawing.step(0.0)
        drawn = look(debug_shapes=drawing.frame)
        sizes.append(int(((drawn[..., 0] > 200) & (drawn[..., 2] < 60)).sum()))
    assert sizes == [36, 36]


def test_an_ignored_vehicle_is_looked_through_by_its_sensor_only(look):
    vehicles = [(3, (5.0, 0.0, 0.0), 90.0)]
    seen = look("camera.semantic_segmentation", vehicles)[..., 2]
    ignored = look("camera.semantic_segmentation", vehicles, ignored=(3,))[..., 2]
    assert (seen == CityObjectLabel.CAR).sum() > 50
    assert not (ignored == CityObjectLabel.CAR).any()


def test_an_open_door_stands_off_the_body(look):
    vehicles = [(3, (6.0, 0.0, 0.0), 0.0)]
    shut = look("camera.semantic_segmentation", vehicles)
    opened = look("camera.semantic_segmentation", vehicles, doors=np.array([15], np.uint8))
    car = CityObjectLabel.CAR
    assert (opened[..., 2] == car).sum() > (shut[..., 2] == car).sum() + 10


def test_shapes_live_as_long_as_they_were_given():
    drawing = DebugDrawing()
    for life_s in (-1.0, 0.1, 0.0):
        drawing.point((life_s, 0.0, 0.0), 1.0, (0, 0, 0), 0.0, life_s)
    alive = []
    for frame in range(1, 5):
        drawing.step(frame * 0.05)
        shapes = drawing.frame
        alive.append([] if shapes is None else shapes.segments[:, 0, 0].tolist())
    assert alive == [[-1.0, 0.1, 0.0], [0.1, 0.0], [0.0], [0.0]]


def test_arrows_and_boxes_consist_of_lines():
    shaft, *head = arrow((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), 0.2)
    assert shaft == ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    assert all(end == (2.0, 0.0, 0.0) for _, end in head)
    assert np.allclose([start[0] for start, _ in head], 1.8)
    edges = box_edges((0.0, 0.0, 1.0), (2.0, 1.0, 1.0), (0.0, 90.0, 0.0))
    assert len(edges) == 12
    ends = np.array(edges).reshape(-1, 3)
    assert np.allclose(np.abs(ends).max(axis=0), [1.0, 2.0, 2.0])


def test_a_new_lamp_has_its_full_intensity():
    assert INTENSITY > 0.0
