"""Are the labels true? Their figures against exact truth from the embedded simulator.

A client (``clients.isolated_objects``) sets up scenes in several towns. It records what labels are
made from, and each object isolated, as no dataset can. The labeller, as it ships, labels the
scenes. Its visible pixels, occlusion, 2D boxes and visibility are compared with what the pictures
of the scene and of the isolated object show; beside it, the decisions of two other tools' methods.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.framework.label_scenes import CAMERA, IsolatedTruth, LabelScene, read_scenes
from benchmarks.framework.label_scores import (
    BOX_PX,
    STAGE_VO,
    Finding,
    estimate,
    estimate_by_peer,
    estimate_by_vertices,
    figures,
    table,
)
from benchmarks.framework.level_truth import LevelFinding, compare_level, level_figures
from benchmarks.framework.masks import inside_polygon, tight_box
from benchmarks.framework.peer_methods import (
    PeerDecision,
    PeerObject,
    class_pixels,
    depth_patch,
)
from carstage.annotation import CameraImages, EpisodeLabeller
from carstage.annotation.classes import RIDER_TAG, WALKER_CLASSES, object_class
from carstage.annotation.decoding import decode_instance_bgra
from carstage.annotation.pixels import BODY_REACH_M, BOX_MARGIN_M
from carstage.bench.episodes import Progress, events_of
from carstage.bench.verdict import Verdict
from carstage.execution import CollectorProcess
from carstage.geometry import (
    Z_NEAR_M,
    FloatArray,
    box_corners,
    clip_to_near_plane,
    convex_hull,
    intrinsics,
    optical_from_world,
    pose_matrix,
    project,
    transform_points,
    world_from_box,
)
from carstage.rawlog.reader import EpisodeLog, WorldFrame
from carstage.server import EmbeddedServer, Endpoint
from carstage.spec.defaults import MAX_DISTANCE_M
from carstage.tags import vehicle_tags, walker_tags

TOWNS: Final = ("Stage01", "Stage02", "Stage03")
SCENES: Final = 14
OBJECTS: Final = 500
CLASSES: Final = 5
TAKEN_AWAY: Final = 5
_VEHICLES, _WALKERS = 9, 6
_SIZE: Final = (640, 360)
_FOV_DEG: Final = 90.0
_TIMEOUT_S: Final = 300.0
"""A client's patience: a town that was never loaded is baked first."""


def measure_labels(
    *,
    towns: Sequence[str] = TOWNS,
    scenes: int = SCENES,
    size: tuple[int, int] = _SIZE,
    seed: int = 1,
    scratch: Path | None = None,
    progress: Progress = lambda done, total: None,
    running: Endpoint | None = None,
    maps: Path | None = None,
    taken_away: int = TAKEN_AWAY,
) -> tuple[Verdict, dict[str, dict[str, int]]]:
    """Set up scenes, label and compare.

    Args:
        towns: where.
        scenes: in each town.
        size: of the pictures (px).
        seed: what the scenes are drawn from.
        scratch: where the raw logs go.
        progress: called with the scenes done and their total number.
        running: the server; None starts one.
        maps: folder of OpenDRIVE files, for towns of which the simulator has none.
        taken_away: the most actors, and the most level objects, of a scene that are taken away.

    Returns:
        The figures, and how many objects there were by class and town.
    """
    findings: list[Finding] = []
    level: list[LevelFinding] = []
    arguments = () if maps is None else ("--maps", str(maps))
    with (
        tempfile.TemporaryDirectory(prefix="carstage-bench-", dir=scratch) as folder,
        _server(running, arguments) as endpoint,
    ):
        for number, town in enumerate(towns):
            where = Path(folder) / town
            where.mkdir()
            plan = {
                "host": endpoint.host,
                "port": endpoint.port,
                "timeout_s": _TIMEOUT_S,
                "town": town,
                "seed": seed + number,
                "scenes": scenes,
                "vehicles": _VEHICLES,
                "walkers": _WALKERS,
                "taken_away": taken_away,
                "size": list(size),
                "fov_deg": _FOV_DEG,
                "folder": str(where / "raw"),
            }
            (where / "raw").mkdir()
            for done in _record(plan, where):
                progress(number * scenes + done, len(towns) * scenes)
            of_actors, of_level = compare(EpisodeLog(where / "raw"), town)
            findings += of_actors
            level += of_level
    return (
        Verdict(
            "labels",
            (
                *figures(findings, objects=OBJECTS, classes=CLASSES, towns=len(TOWNS)),
                *level_figures(level),
            ),
            (
                f"{scenes} scenes in each of {', '.join(towns)}, pictures of "
                f"{size[0]}x{size[1]}; objects within {MAX_DISTANCE_M:g} m of which the isolated "
                "picture shows a pixel.",
            ),
        ),
        table(
            [
                *((found.object_class, found.town) for found in findings),
                *((f"{found.object_class} of the level", found.town) for found in level),
            ]
        ),
    )


@contextmanager
def _server(running: Endpoint | None, arguments: Sequence[str]) -> Iterator[Endpoint]:
    if running is not None:
        yield running
        return
    with EmbeddedServer(arguments=arguments) as server:
        yield server.endpoint


def _record(plan: Mapping[str, Any], folder: Path) -> Iterator[int]:
    """Let the client record a town; yields the number of scenes done."""
    client = CollectorProcess(
        plan,
        plan_path=folder / "plan.json",
        log_path=folder / "client.log",
        module="benchmarks.framework.clients.isolated_objects",
    )
    with client:
        for event in events_of(client):
            if event["event"] == "tick":
                yield event["tick"] + 1


def compare(log: EpisodeLog, town: str) -> tuple[list[Finding], list[LevelFinding]]:
    """Label the scenes of a recording and compare each object with the truth."""
    found: list[Finding] = []
    level: list[LevelFinding] = []
    objects, server = log.level_objects(), str(log.header["server_version"])
    labeller = EpisodeLabeller(log.header, log.actors(), level_objects=objects)
    for scene in read_scenes(log):
        rows = {
            method: _rows(labeller, scene, images) for method, images in _evidence(scene).items()
        }
        optical = _camera(log.header, scene.world)
        peers = _peers(scene, optical, server)
        for number, truth in enumerate(scene.truths):
            box = _world_from_box(scene.world, truth)
            if np.linalg.norm(transform_points(optical, box[:3, 3])) <= MAX_DISTANCE_M:
                of_peers = {name: found_by[number] for name, found_by in peers.items()}
                found.append(_finding(town, scene, truth, rows, of_peers, optical, box))
        height, width = scene.depth_m.shape
        k = intrinsics(width, height, _FOV_DEG)
        level += compare_level(
            town, scene, objects, server, rows["instance"], optical, k, MAX_DISTANCE_M
        )
    return found, level


def _evidence(scene: LabelScene) -> dict[str, CameraImages]:
    """The same pictures as each method gets them."""
    _, tags = decode_instance_bgra(scene.instance_bgra)
    return {
        "instance": CameraImages(scene.depth_m, scene.instance_bgra),
        "depth and tags": CameraImages(scene.depth_m, semantic_tag=tags),
        "depth": CameraImages(scene.depth_m),
    }


def _peers(
    scene: LabelScene, optical: FloatArray, server: str
) -> dict[str, Sequence[PeerDecision]]:
    """What methods of other tools say of the objects of a scene, in their order."""
    _, tags = decode_instance_bgra(scene.instance_bgra)
    height, width = scene.depth_m.shape
    k = intrinsics(width, height, _FOV_DEG)
    is_walker = np.isin(tags, list(walker_tags(server)))
    # Riders belong to the vehicles of the servers that CarFree was written for.
    is_vehicle = np.isin(tags, [*vehicle_tags(server), RIDER_TAG])
    objects = [
        PeerObject.of(
            optical,
            _world_from_box(scene.world, truth),
            truth.actor.box_extent,
            scene.world.location[scene.world.row(truth.actor.id)],
            is_walker=object_class(truth.actor) in WALKER_CLASSES,
        )
        for truth in scene.truths
    ]
    return {
        "carla_2dbbox": [depth_patch(one, k, scene.depth_m) for one in objects],
        "carla_2dbbox_as_described": [
            depth_patch(one, k, scene.depth_m, as_described=True) for one in objects
        ],
        "carfree": class_pixels(objects, k, is_vehicle, is_walker),
        "carfree_any_size": class_pixels(objects, k, is_vehicle, is_walker, any_size=True),
    }


def _rows(
    labeller: EpisodeLabeller, scene: LabelScene, images: CameraImages
) -> dict[int, dict[str, Any]]:
    labels = labeller.label_frame(scene.world, scene.number, {CAMERA: images}, {})
    return {row["track_id"]: row for row in labels.camera_objects}


def _finding(
    town: str,
    scene: LabelScene,
    truth: IsolatedTruth,
    rows: Mapping[str, Mapping[int, dict[str, Any]]],
    peers: Mapping[str, PeerDecision],
    optical: FloatArray,
    box: FloatArray,
) -> Finding:
    visible_px = int(truth.visible.sum())
    true_box = tight_box(truth.visible) if visible_px >= BOX_PX else None
    of_actor = {method: found.get(truth.actor.id) for method, found in rows.items()}
    labels = {method: estimate(row, true_box) for method, row in of_actor.items()}
    labels[STAGE_VO] = estimate_by_vertices(of_actor["instance"])
    labels |= {peer: estimate_by_peer(one, true_box) for peer, one in peers.items()}
    height, width = scene.depth_m.shape
    kind = object_class(truth.actor) or ""
    reach_m = BODY_REACH_M if kind in WALKER_CLASSES else BOX_MARGIN_M
    corners = transform_points(optical, box_corners(box, truth.actor.box_extent + reach_m))
    hull = convex_hull(
        project(clip_to_near_plane(corners, Z_NEAR_M), intrinsics(width, height, _FOV_DEG))
    )
    return Finding(
        town=town,
        object_class=kind,
        visible_px=visible_px,
        isolated_px=int(truth.isolated.sum()),
        outside_px=int((~inside_polygon(truth.isolated, hull)).sum()),
        stray_px=int((truth.visible & ~truth.isolated).sum()),
        missed_px=None if truth.missed is None else int(truth.missed.sum()),
        labels=labels,
    )


def _camera(header: Mapping[str, Any], world: WorldFrame) -> FloatArray:
    """``(4, 4)`` world to optical axes of the camera."""
    row = world.row(header["sensor_actor_ids"][CAMERA])
    return optical_from_world(pose_matrix(world.location[row], world.rotation_deg[row]))


def _world_from_box(world: WorldFrame, truth: IsolatedTruth) -> FloatArray:
    row, actor = world.row(truth.actor.id), truth.actor
    return world_from_box(
        world.location[row], world.rotation_deg[row], actor.box_location, actor.box_rotation_deg
    )
