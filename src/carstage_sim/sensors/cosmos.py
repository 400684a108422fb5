"""The control picture for video models (``sensor.camera.cosmos_visualization``, 0.9.16).

CARLA's draws what a model must keep on black: boxes around traffic, lights and signs, and poles as
lines (``CosmosControlSensor.cpp`` of its plugin, whose colours these are). Its routes, stop lines
and crosswalks are not drawn here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.street_furniture import light_mast_height_m
from carstage_sim.content.wheelchairs import EXTENT
from carstage_sim.geometry import pose_matrix, rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import OrientedBox, Town
from carstage_sim.render.overlay import draw_shapes
from carstage_sim.sensors.cameras import CameraSensor
from carstage_sim.sensors.measurements import ImageFrame, SensorRequest
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.signals.traffic_light_actors import head_boxes
from carstage_sim.world.state import ActorKind, WorldState

Rgb = tuple[int, int, int]
_Lines = tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.uint8]]
"""Ends ``(L, 2, 3)`` in the world, widths in metres and colours of lines."""

_LIGHT: Rgb = (252, 157, 155)
_SIGN: Rgb = (131, 175, 155)
_POLE: Rgb = (66, 40, 144)
_VEHICLE: Rgb = (255, 0, 0)
_WALKER: Rgb = (0, 255, 0)
_LINE_M = 0.10
_NEAR_M = 0.1
_FAR_M = 150.0

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_EDGES = [
    (a, b)
    for a in range(8)
    for b in range(a + 1, 8)
    if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 2
]
"""Corners that differ in one coordinate."""


@SensorRegistry.register("sensor.camera.cosmos_visualization")
class CosmosCamera(CameraSensor):
    """Lines around what moves and what rules it."""

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        self._blueprints = catalogue()
        self._scenery, self._owner = _scenery(town)

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> ImageFrame:
        """The lines on black, alpha 255."""
        ends, width, colour = self._lines(state, request.ignored)
        offset = ends - np.asarray(request.location)
        near = np.linalg.norm(offset, axis=2).min(axis=1) < _FAR_M
        rotation = rotation_matrix(request.rotation_deg)
        # Sums written out: a matrix product may add in another order on another machine.
        seen = sum(offset[near][..., axis, None] * rotation[axis] for axis in range(3))
        picture = np.zeros((self.height, self.width, 3), np.uint8)
        draw_shapes(
            np.asarray(seen, np.float64).reshape(-1, 2, 3),
            width[near],
            np.zeros(int(near.sum()), np.bool_),
            colour[near],
            focal_px=self.width / (2.0 * np.tan(np.radians(self.fov_deg) / 2.0)),
            near_m=_NEAR_M,
            depth=np.full((self.height, self.width), np.inf, np.float32),
            pixels=picture,
        )
        pixels = np.full((self.height, self.width, 4), 255, np.uint8)
        pixels[..., :3] = picture[..., ::-1]
        return self.image(pixels)

    def _lines(self, state: WorldState, ignored: frozenset[int]) -> _Lines:
        hidden = [] if state.town_changes is None else list(state.town_changes.hidden)
        ends, width, colours = self._scenery
        shown = ~np.isin(self._owner, hidden)
        parts = [(ends[shown], width[shown], colours[shown])]
        for row, kind in enumerate(state.kind.tolist()):
            if kind not in (ActorKind.VEHICLE, ActorKind.WALKER):
                continue
            blueprint, actor_id = self._blueprints.get(state.type_id[row]), int(state.actor_id[row])
            # Of what a sensor is to ignore CARLA's asks whether it is a vehicle.
            passed = kind == ActorKind.VEHICLE and actor_id in ignored
            if blueprint is None or passed or actor_id == state.hero_id:
                continue
            matrix = pose_matrix(state.location[row], state.rotation_deg[row])
            colour = _VEHICLE if kind == ActorKind.VEHICLE else _WALKER
            extent = EXTENT if actor_id in state.wheelchairs else blueprint.box_extent
            parts.append(_box(matrix, blueprint.box_center, extent, colour))
        return _joined(parts)


def _box(
    world_from_box: NDArray[np.float64],
    center: tuple[float, float, float],
    extent: tuple[float, float, float],
    colour: Rgb,
) -> _Lines:
    corners = _CORNERS * extent + center
    placed = corners @ world_from_box[:3, :3].T + world_from_box[:3, 3]
    ends = np.array([[placed[a], placed[b]] for a, b in _EDGES])
    count = len(_EDGES)
    return ends, np.full(count, _LINE_M, np.float32), np.full((count, 3), colour, np.uint8)


def _oriented(box: OrientedBox, colour: Rgb) -> _Lines:
    return _box(pose_matrix(box.center, box.rotation_deg), (0.0, 0.0, 0.0), box.extent, colour)


def _pole(foot: NDArray[np.float64], height_m: float) -> _Lines:
    ends = foot + np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, height_m]]])
    return ends, np.full(1, _LINE_M, np.float32), np.array([_POLE], np.uint8)


def _joined(parts: Sequence[_Lines]) -> _Lines:
    nothing = np.empty((0, 2, 3)), np.empty(0, np.float32), np.empty((0, 3), np.uint8)
    ends, widths, colours = zip(nothing, *parts, strict=True)
    return np.concatenate(ends), np.concatenate(widths), np.concatenate(colours)


def _scenery(town: Town) -> tuple[_Lines, NDArray[np.int64]]:
    """Boxes of signs and of the heads of traffic lights; poles and masts that stand upright.

    Returns:
        The lines, and ``(L,)`` the level object that each belongs to, 0 for lights.
    """
    parts: list[tuple[int, _Lines]] = []
    for site in town.traffic_lights:
        parts += [(0, _oriented(box, _LIGHT)) for box in head_boxes(site)]
        parts.append((0, _pole(np.array(site.location), light_mast_height_m(site.head))))
    for piece in town.level_objects:
        box = piece.box
        if piece.label == CityObjectLabel.TRAFFIC_SIGNS:
            parts.append((piece.object_id, _oriented(box, _SIGN)))
        elif piece.label == CityObjectLabel.POLES and box.extent[2] >= max(box.extent[:2]):
            foot = np.array(box.center) - np.array([0.0, 0.0, box.extent[2]])
            parts.append((piece.object_id, _pole(foot, 2.0 * box.extent[2])))
    owner = np.array([object_id for object_id, lines in parts for _ in lines[0]], np.int64)
    return _joined([lines for _, lines in parts]), owner
