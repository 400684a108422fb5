"""Renders the pictures of a comparison, with whatever code Python finds first.

Run as a file, with a destination and the arguments of :func:`render` as JSON. So one source renders
with the code of two revisions; it uses only what both have.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render.scene import named_presets, populate, rgb, town_of
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.measurements import FlowFrame, SensorFrame

_EYE_M = 1.7
_STEP_M, _TURN_DEG = 0.4, 0.5


def render(
    towns: Sequence[str], weathers: Sequence[str], places: int, width: int, height: int, seed: int
) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Two pictures of each place and weather, a step of the camera apart, and the flow between."""
    for town in towns:
        map_ = town_of(town)
        with WorldSensors(map_) as sensors:
            scene = populate(map_, sensors, vehicles=40, walkers=15, seed=seed)
            chosen = np.linspace(0, len(map_.spawn_points) - 1, places).astype(int)
            for weather in weathers:
                for number, place in enumerate(chosen.tolist()):
                    x, y, z, _, yaw, _ = map_.spawn_points[place].tolist()
                    ahead = np.array([np.cos(np.radians(yaw)), np.sin(np.radians(yaw)), 0.0])
                    scene.sensors.reset()
                    frames: list[dict[int, SensorFrame]] = []
                    for step in range(2):
                        eye = np.array([x, y, z + _EYE_M]) + ahead * _STEP_M * step
                        scene.location = (float(eye[0]), float(eye[1]), float(eye[2]))
                        scene.rotation_deg = (-4.0, yaw + _TURN_DEG * step, 0.0)
                        size = {"image_size_x": width, "image_size_y": height}
                        state = scene.state(named_presets()[weather])
                        requests = [
                            scene.request("camera.rgb", 0, **size),
                            scene.request("camera.optical_flow", 1, **size),
                        ]
                        captured = scene.sensors.capture(state, requests)
                        frames.append({one - 900_000: frame for one, frame in captured})
                    name = f"{town} {weather} {number}"
                    flow = frames[1][1]
                    assert isinstance(flow, FlowFrame)
                    yield f"{name} 0", rgb(frames[0][0])
                    yield f"{name} 1", rgb(frames[1][0])
                    yield f"{name} flow", flow.flow


if __name__ == "__main__":
    destination, settings = sys.argv[1], json.loads(sys.argv[2])
    np.savez_compressed(destination, allow_pickle=False, **dict(render(**settings)))
