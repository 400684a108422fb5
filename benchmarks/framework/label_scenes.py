"""Scenes that ``clients.isolated_objects`` recorded, with the truth about each object's pixels.

A raw log with the streams that labels need and two more. ``ISOLATED``: for each object that was
placed, which pixels it covers when it is the only thing there is. ``TAKEN_AWAY``: for some of them
and some of the level, which pixels show something else without it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from carstage.annotation.decoding import decode_depth_bgra, decode_instance_bgra
from carstage.rawlog.format import KIND_DATA
from carstage.rawlog.reader import ActorInfo, EpisodeLog, Record, WorldFrame

CAMERA: Final = "CAM"
DEPTH: Final = "CAM.depth"
INSTANCE: Final = "CAM.instance"
ISOLATED: Final = "isolated"
TAKEN_AWAY: Final = "taken_away"
LEVEL_KINDS: Final = ("parked_vehicles", "traffic_lights", "traffic_signs")
SCENES_FPS: Final = 20.0


def episode_header(
    plan: Mapping[str, Any],
    *,
    server_version: str,
    ego_id: int,
    camera_id: int,
    timestamp_s: float,
) -> dict[str, Any]:
    """The raw log's ``episode.json``: a labelled camera that stands free.

    Args:
        plan: the client's.
        server_version: as the server reports it.
        ego_id: the vehicle that stands for the ego; no camera sees it.
        camera_id: the actor whose pose is the camera's.
        timestamp_s: of the first scene.
    """
    width, height = plan["size"]
    attributes = {
        "image_size_x": str(width),
        "image_size_y": str(height),
        "fov": str(plan["fov_deg"]),
    }
    camera = bare_sensor(
        CAMERA,
        "rgb",
        labelled=True,
        attach_to="world",
        attributes=attributes,
        depth=DEPTH,
        instance=INSTANCE,
    )
    return {
        "format_version": 1,
        "episode_id": f"scenes-{plan['town']}",
        "server_version": server_version,
        "map": plan["town"],
        "geo_reference": {"latitude_deg": 0.0, "longitude_deg": 0.0, "altitude_m": 0.0},
        "ego_id": ego_id,
        "first_timestamp_s": timestamp_s,
        "sensor_actor_ids": {CAMERA: camera_id},
        "sensor_carrier_ids": {CAMERA: 0},
        "ticks": plan["scenes"],
        "ticks_per_segment": plan["scenes"],
        "spec": bare_spec([camera], fps=SCENES_FPS, ground_truth={"ego_motion": False}),
    }


@dataclass(frozen=True, slots=True)
class IsolatedTruth:
    """The truth about one object in one scene.

    Attributes:
        actor: the object.
        isolated: ``(H, W)`` which pixels it covers without anything else.
        visible: ``(H, W)`` which pixels of the scene's picture are its own.
        missed: ``(H, W)`` which pixels' depth is another without it; None: it was not taken away.
    """

    actor: ActorInfo
    isolated: NDArray[np.bool_]
    visible: NDArray[np.bool_]
    missed: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True)
class LabelScene:
    """One scene: what labels are made from, and the truth.

    Attributes:
        number: of the scene.
        world: its state.
        depth_m: ``(H, W)`` float32 z-depth.
        instance_bgra: ``(H, W, 4)`` uint8.
        truths: the objects that cover a pixel when nothing else is there.
        missed: by id of a level object that was taken away, ``(H, W)`` where the depth is another.
    """

    number: int
    world: WorldFrame
    depth_m: NDArray[np.float32]
    instance_bgra: NDArray[np.uint8]
    truths: tuple[IsolatedTruth, ...]
    missed: Mapping[int, NDArray[np.bool_]]


def read_scenes(log: EpisodeLog) -> Iterator[LabelScene]:
    """The scenes of a recording, in order."""
    actors = log.actors()
    pictures = {
        name: {record.tick: record for record in log.read_segment(name, 0)}
        for name in (DEPTH, INSTANCE)
    }
    isolated, taken_away = _by_scene(log, ISOLATED), _by_scene(log, TAKEN_AWAY)
    for world in log.world_frames(0):
        instance_bgra = _bgra(pictures[INSTANCE][world.tick])
        ids, _ = decode_instance_bgra(instance_bgra)
        missed = {
            (record.meta.get("actor"), record.meta.get("object")): _whole(record, ids.shape)
            for record in taken_away.get(world.tick, ())
        }
        truths = tuple(
            IsolatedTruth(
                actors[record.meta["actor"]],
                _whole(record, ids.shape),
                ids == record.meta["actor"] & 0xFFFF,
                missed.get((record.meta["actor"], None)),
            )
            for record in isolated.get(world.tick, ())
            if record.meta["width"]
        )
        yield LabelScene(
            world.tick,
            world,
            decode_depth_bgra(_bgra(pictures[DEPTH][world.tick])),
            instance_bgra,
            truths,
            {number: mask for (_, number), mask in missed.items() if number is not None},
        )


def _by_scene(log: EpisodeLog, stream: str) -> dict[int, list[Record]]:
    """The masks of a stream."""
    found: dict[int, list[Record]] = {}
    for record in log.read_segment(stream, 0):
        if record.kind == KIND_DATA:
            found.setdefault(int(record.meta["scene"]), []).append(record)
    return found


def _bgra(record: Record) -> NDArray[np.uint8]:
    shape = (int(record.meta["height"]), int(record.meta["width"]), 4)
    return np.frombuffer(record.payload, np.uint8).reshape(shape)


def _whole(record: Record, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """An isolated object's pixels in the whole image."""
    mask = np.zeros(shape, dtype=np.bool_)
    meta = record.meta
    crop = np.frombuffer(record.payload, np.bool_).reshape(meta["height"], meta["width"])
    mask[meta["y0"] : meta["y0"] + meta["height"], meta["x0"] : meta["x0"] + meta["width"]] = crop
    return mask
