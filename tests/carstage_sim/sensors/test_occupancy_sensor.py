"""Voxels that surfaces pass through: beside linear programmes, whose they are, what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.attributes import SensorAttributeError
from carstage_sim.sensors.measurements import SemanticLidarFrame
from carstage_sim.world.state import WorldState
from sensor_worlds import GROUND, WALL, request, state, town

SMALL = {"ahead": 2, "behind": 2, "left": 2, "right": 1, "up": 2, "down": 1, "resolution": 0.25}
SIZE = (16, 12, 12)
LOW_M = np.array([-2.0, -1.0, -1.0])
"""Forward, left and up."""
CAR = 40
TURN = (4.0, 33.0, -7.0)
PLACE = (0.3, -0.2, 0.1)


def asked(**attributes: object):  # type: ignore[no-untyped-def]
    place = {
        name: attributes.pop(name) for name in ("location", "rotation_deg") if name in attributes
    }
    return request("other.occupancy", 300, **place, **(SMALL | attributes))


def seen(
    meshes: list[TriangleMesh], world: WorldState, folder: Path, **attributes: object
) -> NDArray[np.void]:
    with WorldSensors(town(*meshes), threads=1, cache=folder) as sensors:
        ((sensor_id, frame),) = sensors.capture(world, [asked(**attributes)])
    assert sensor_id == 300
    assert isinstance(frame, SemanticLidarFrame)
    assert frame.channel_counts.tolist() == [len(frame.points)]
    return frame.points


def cells(points: NDArray[np.void], side_m: float = 0.25) -> NDArray[np.int64]:
    flu = np.stack([points["x"], -points["y"], points["z"]], axis=-1)
    units = (flu - LOW_M) / side_m
    assert np.allclose(units % 1.0, 0.5, atol=1e-4)
    return np.floor(units).astype(np.int64)


def soup(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """``(N, 3, 3)`` triangles of all sizes in the voxels' axes, in voxels."""
    middle = rng.uniform(0, SIZE, (count, 1, 3))
    reach = 10.0 ** rng.uniform(-1.0, 1.2, (count, 1, 1))
    return middle + reach * rng.normal(size=(count, 3, 3))


def mesh_of(corners: NDArray[np.float64], tag: int) -> TriangleMesh:
    """A mesh in the world of triangles in the voxels' axes."""
    flu = corners.reshape(-1, 3) * 0.25 + LOW_M
    world = (flu * [1, -1, 1]) @ rotation_matrix(TURN).reshape(3, 3).T + PLACE
    return build_mesh(world, np.arange(len(flu)).reshape(-1, 3), Material.CONCRETE, tag)


def meets(triangle: NDArray[np.float64], cell: NDArray[np.int64], slack: float) -> bool:
    """Whether a point of a triangle is in a voxel: a linear programme of its three weights."""
    bounds = np.concatenate([cell + 1 + slack, slack - cell])
    rows = np.concatenate([triangle.T, -triangle.T])
    return bool(linprog(np.zeros(3), rows, bounds, np.ones((1, 3)), [1.0]).success)


def neighbours(cell: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    for axis in range(3):
        for step in (-1, 1):
            beside = cell + step * (np.arange(3) == axis)
            if ((beside >= 0) & (beside < SIZE)).all():
                yield beside


def test_voxels_are_those_that_a_triangle_passes_through(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    compared = 0
    for triangle in soup(24, rng):
        mesh = mesh_of(triangle, CityObjectLabel.STATIC)
        points = seen([mesh], state(), tmp_path, location=PLACE, rotation_deg=TURN)
        found = {tuple(cell) for cell in cells(points).tolist()}
        chosen = rng.permutation(np.array(sorted(found)).reshape(-1, 3))[:12]
        for cell in chosen:
            assert meets(triangle, cell, 1e-3), (triangle, cell)
            for beside in neighbours(cell):
                if tuple(beside.tolist()) not in found:
                    assert not meets(triangle, beside, -1e-3), (triangle, beside)
                    compared += 1
        inside = triangle[((triangle >= 0.01) & (triangle < np.array(SIZE) - 0.01)).all(axis=1)]
        assert {tuple(cell) for cell in np.floor(inside).astype(int).tolist()} <= found
    assert compared > 200


def test_many_triangles_are_as_each_alone(tmp_path: Path) -> None:
    triangles = soup(5000, np.random.default_rng(6))
    alone = [mesh_of(part, CityObjectLabel.STATIC) for part in (triangles[:2500], triangles[2500:])]
    pose = {"location": PLACE, "rotation_deg": TURN}
    halves = [
        {tuple(c) for c in cells(seen([m], state(), tmp_path, **pose)).tolist()} for m in alone
    ]
    together = cells(seen(alone, state(), tmp_path, **pose)).tolist()
    assert {tuple(cell) for cell in together} == halves[0] | halves[1]
    assert together == sorted(together)
    assert len(together) == len({tuple(cell) for cell in together})  # one owner: one point each


def test_what_lies_on_a_face_is_in_the_voxel_above_it(tmp_path: Path) -> None:
    points = seen([GROUND], state(), tmp_path, location=(0.0, 0.0, 0.0))
    top, bottom = points[points["z"] > 0], points[points["z"] < 0]
    assert set(top["z"].tolist()) == {0.125}
    assert set(bottom["z"].tolist()) == {-0.875}
    assert len(top) == len(bottom) == SIZE[0] * SIZE[1]


def test_a_voxel_has_the_tag_of_most_surface_in_it(tmp_path: Path) -> None:
    """A road and a pavement meet at y = 0.1, at two fifths of a voxel."""

    def slab(low_y: float, high_y: float, tag: int) -> TriangleMesh:
        corners = np.array([[-9, low_y, 0.1], [9, low_y, 0.1], [9, high_y, 0.1], [-9, high_y, 0.1]])
        return build_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), Material.ASPHALT, tag)

    road, walk = CityObjectLabel.ROADS, CityObjectLabel.SIDEWALKS
    meshes = [slab(-9, 0.1, road), slab(0.1, 9, walk)]
    points = seen(meshes, state(), tmp_path, location=(0.0, 0.0, 0.0))
    assert len(points) == SIZE[0] * SIZE[1]
    expected = np.where(points["y"] < 0, road, walk)
    assert np.array_equal(points["object_tag"], expected)
    points = seen(meshes, state(), tmp_path, location=(0.0, -0.05, 0.0))
    assert np.array_equal(points["object_tag"], np.where(points["y"] < 0.2, road, walk))


def test_actors_come_with_their_ids_beside_the_town(tmp_path: Path) -> None:
    world = state(vehicles=[(CAR, (0.0, 0.0, 0.0), 20.0)])
    wide = dict.fromkeys(("ahead", "behind", "left", "right"), 4)
    points = seen([GROUND, WALL], world, tmp_path, location=(0.0, 0.0, 0.05), down=0.5, **wide)
    car = points[points["object_idx"] == CAR]
    assert set(car["object_tag"].tolist()) == {int(CityObjectLabel.CAR)}
    assert 300 < len(car) < 3000
    assert np.abs(car["x"]).max() < 2.8
    ground = points[points["object_idx"] == 0]
    assert len(ground) == 32 * 32  # under the car, too


def test_hidden_and_ignored_things_are_not_there(tmp_path: Path) -> None:
    from dataclasses import replace

    from carstage_sim.world.town_changes import TownChanges

    world = replace(
        state(vehicles=[(CAR, (0.0, 0.0, 0.0), 0.0)]),
        town_changes=TownChanges(hidden=frozenset({5})),
    )
    near_wall = {"location": (9.5, 0.0, 0.0)}
    before = seen([GROUND, WALL], state(), tmp_path, **near_wall)
    assert CityObjectLabel.BUILDINGS in before["object_tag"]
    after = seen([GROUND, WALL], world, tmp_path, **near_wall)
    assert set(after["object_tag"].tolist()) == {int(CityObjectLabel.ROADS)}
    with WorldSensors(town(GROUND), threads=1, cache=tmp_path) as sensors:
        through = replace(asked(location=(0.0, 0.0, 0.0)), ignored=frozenset({CAR}))
        ((_, frame),) = sensors.capture(world, [through])
    assert set(frame.points["object_idx"].tolist()) == {0}


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ({"resolution": 0}, "resolution must be above 0"),
        ({"ahead": -1}, "none below 0"),
        ({"ahead": 2.1}, "no whole numbers"),
        ({"up": 0, "down": 0}, "no whole numbers"),
        ({"ahead": 500, "left": 500, "up": 500}, "voxels are above 4194304"),
        ({"left": "wide"}, "not a finite number"),
    ],
)
def test_impossible_voxels_are_refused(
    attributes: dict[str, object], said: str, tmp_path: Path
) -> None:
    with pytest.raises(SensorAttributeError, match=said):
        seen([GROUND], state(), tmp_path, **attributes)


def test_the_carrier_comes_too_when_its_wheels_move_by_themselves(tmp_path: Path) -> None:
    """Near a sensor of the world they do."""
    wide = dict.fromkeys(("ahead", "behind", "left", "right"), 4)
    within = request(
        "other.occupancy", 300, location=(0.0, 0.0, 1.0), owner_id=CAR, **(SMALL | wide)
    )
    counts = []
    for near in ([], [(300, (0.0, 0.0, 1.0), 0.0)]):
        world = state(vehicles=[(CAR, (0.0, 0.0, 0.0), 0.0)], sensors=near)
        with WorldSensors(town(GROUND), threads=1, cache=tmp_path) as sensors:
            ((_, frame),) = sensors.capture(world, [within])
        car = frame.points[frame.points["object_idx"] == CAR]
        counts.append(len(car))
        places = [car[axis].tolist() for axis in ("x", "y", "z")]
        assert len(set(zip(*places, strict=True))) == len(car), "a voxel comes once for each actor"
    assert counts[1] == pytest.approx(counts[0], rel=0.02)
    assert counts[0] > 300
