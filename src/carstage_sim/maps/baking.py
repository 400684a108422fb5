"""The bake: from a street plan to a finished town."""

from __future__ import annotations

import dataclasses
import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from carstage_sim.maps.cache import digest_of
from carstage_sim.maps.ground_mesh import ground_mesh
from carstage_sim.maps.layout import build_network
from carstage_sim.maps.lights import light_sites
from carstage_sim.maps.navmesh import navigation_file
from carstage_sim.maps.opendrive_writer import write_opendrive
from carstage_sim.maps.plan import TownPlan
from carstage_sim.maps.scenery import scenery
from carstage_sim.maps.spawning import spawn_points
from carstage_sim.maps.strips import Samples, crosswalks, driving_lanes, strips
from carstage_sim.maps.surfaces import ground_layers, surfaces
from carstage_sim.maps.town import Town
from carstage_sim.maps.walkways import walkways
from carstage_sim.mesh import merge_meshes

_SAMPLING_LIMIT_S = 120.0


class MapSamplingError(RuntimeError):
    """The client's map reader could not read an OpenDRIVE file."""


def bake(plan: TownPlan) -> Town:
    """Bakes a planned town; equal plans give equal towns, to the byte.

    Raises:
        MapSamplingError: if the child process that samples the OpenDRIVE file fails.
    """
    network = build_network(plan)
    opendrive = write_opendrive(network)
    samples = sample_in_child(opendrive, plan.name)
    lanes = strips(samples)
    seed = int.from_bytes(hashlib.sha256(plan.name.encode()).digest()[:8], "big")
    spawn_rng, scenery_rng = np.random.default_rng(seed).spawn(2)
    ground = surfaces(lanes, crosswalks(samples))
    stage = scenery(ground, lanes, network, scenery_rng)
    mesh = ground_mesh(ground_layers(ground, lanes, network, stage.pits))
    town = Town(
        name=plan.name,
        opendrive=opendrive,
        geo_reference=(plan.latitude_deg, plan.longitude_deg),
        spawn_points=spawn_points(lanes, spawn_rng),
        lanes=driving_lanes(samples),
        traffic_lights=light_sites(network),
        navigation=navigation_file(walkways(ground)),
        static_mesh=merge_meshes([mesh, *stage.meshes]),
        level_objects=tuple(stage.objects),
        digest="",
    )
    return dataclasses.replace(town, digest=digest_of(town))


def sample_in_child(opendrive: str, name: str) -> Samples:
    """Lane samples of an OpenDRIVE text, made by ``carstage_sim.maps.opendrive`` in a process.

    Raises:
        MapSamplingError: with the child's last words.
    """
    with tempfile.TemporaryDirectory(prefix="carstage-map-") as folder:
        source, target = Path(folder) / f"{name}.xodr", Path(folder) / "samples.npz"
        source.write_text(opendrive, encoding="utf-8")
        command = [sys.executable, "-m", "carstage_sim.maps.opendrive", str(source), str(target)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=_SAMPLING_LIMIT_S, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise MapSamplingError(
                f"map {name}: sampling took longer than {_SAMPLING_LIMIT_S:.0f} s"
            ) from error
        if done.returncode != 0 or not target.exists():
            raise MapSamplingError(
                f"map {name}: the map reader ended with code {done.returncode}: "
                f"{done.stderr.strip()[-800:]}"
            )
        with np.load(target) as arrays:
            return {key: arrays[key] for key in arrays.files}
