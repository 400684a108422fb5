"""Does a server's memory stay flat over ticks, rigs that come and go, and loads of the map?"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import carla

from benchmarks.process_figures import open_files, rss_mb, threads
from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import started_server
from benchmarks.simulator.session import Session, spawn_traffic, synchronous_session
from carstage.bench.verdict import Figure, Verdict

_FPS = 20
_TIMEOUT_S = 60.0
_SAMPLES = 50
_SETTLED = 0.1
"""Share of a phase after which its memory is the one to compare with."""
FLAT = 0.05
RIG = {
    "sensor.camera.rgb": {"image_size_x": "96", "image_size_y": "64"},
    "sensor.camera.depth": {"image_size_x": "96", "image_size_y": "64"},
    "sensor.camera.semantic_segmentation": {"image_size_x": "96", "image_size_y": "64"},
    "sensor.camera.instance_segmentation": {"image_size_x": "96", "image_size_y": "64"},
    "sensor.camera.normals": {"image_size_x": "96", "image_size_y": "64"},
    "sensor.camera.optical_flow": {"image_size_x": "96", "image_size_y": "64"},
    "sensor.camera.dvs": {"image_size_x": "96", "image_size_y": "64"},
    "sensor.lidar.ray_cast": {"points_per_second": "20000"},
    "sensor.lidar.ray_cast_semantic": {"points_per_second": "20000"},
    "sensor.other.radar": {},
    "sensor.other.imu": {},
    "sensor.other.gnss": {},
    "sensor.other.collision": {},
    "sensor.other.obstacle": {},
    "sensor.other.lane_invasion": {},
}


@dataclass(slots=True)
class Phase:
    """Memory of the server over one phase: samples in MB, first to last."""

    name: str
    steps: int
    samples_mb: list[float] = field(default_factory=list)

    @property
    def settled_mb(self) -> float:
        """Memory when the phase had settled."""
        return self.samples_mb[round(_SETTLED * (len(self.samples_mb) - 1))]

    @property
    def spread(self) -> float:
        """Largest deviation from it afterwards, as a share of it."""
        later = self.samples_mb[round(_SETTLED * (len(self.samples_mb) - 1)) :]
        return max(abs(sample / self.settled_mb - 1.0) for sample in later)


def memory_trial(
    port: int, server_pid: int, *, vehicles: int, ticks: int, cycles: int, seed: int
) -> list[Phase]:
    """Ticks traffic, then mounts and dismounts a rig, then loads maps; in the client's process."""
    phases = []
    with synchronous_session(port, delta_s=1.0 / _FPS, seed=seed) as session:
        spawn_traffic(session, vehicles)
        carrier = session.world.get_actors().filter("vehicle.*")[0]
        sensors = _mount(
            session, carrier, ["sensor.other.gnss", "sensor.camera.semantic_segmentation"]
        )
        phases.append(_sampled("ticks", ticks, server_pid, lambda: session.clock.tick()))
        _dismount(sensors)

        def cycle() -> None:
            sensors = _mount(session, carrier, list(RIG))
            for _ in range(3):
                session.clock.tick()
            _dismount(sensors)
            session.clock.tick()

        phases.append(_sampled("rigs", cycles, server_pid, cycle))
    return phases


def load_trial(port: int, server_pid: int, *, loads: int) -> Phase:
    """Loads the map again and again, without a Traffic Manager; in the client's process."""
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_TIMEOUT_S)
    name = client.get_world().get_map().name

    def load() -> None:
        world = client.load_world(name)
        library = world.get_blueprint_library()
        point = world.get_map().get_spawn_points()[0]
        world.spawn_actor(library.find("vehicle.tesla.model3"), point)
        world.wait_for_tick(_TIMEOUT_S)

    return _sampled("loads", loads, server_pid, load)


def _sampled(name: str, steps: int, server_pid: int, step: Any) -> Phase:
    phase = Phase(name, steps)
    every = max(steps // _SAMPLES, 1)
    for number in range(steps):
        step()
        if (number + 1) % every == 0:
            phase.samples_mb.append(rss_mb(server_pid))
    return phase


def _mount(session: Session, carrier: carla.Vehicle, kinds: list[str]) -> list[carla.Sensor]:
    """Sensors on a vehicle, all of them listened to."""
    library = session.world.get_blueprint_library()
    sensors = []
    for kind in kinds:
        blueprint = library.find(kind)
        for name, value in RIG[kind].items():
            blueprint.set_attribute(name, value)
        place = carla.Transform(carla.Location(x=0.5, z=2.0))
        sensor = session.world.spawn_actor(blueprint, place, attach_to=carrier)
        sensor.listen(_discard)
        sensors.append(sensor)
    return sensors


def _discard(_data: Any) -> None:
    """What counts is that it was sent."""


def _dismount(sensors: list[carla.Sensor]) -> None:
    for sensor in sensors:
        sensor.stop()
        sensor.destroy()


def check_memory(
    *, vehicles: int = 30, ticks: int = 20_000, cycles: int = 200, loads: int = 20, seed: int = 7
) -> Verdict:
    """Samples the server's memory through three phases and judges how flat each was."""
    with started_server(("--map", "Stage01")) as server:
        before_mb = rss_mb(server.pid)
        phases = run_trial(
            memory_trial,
            server.port,
            server.pid,
            vehicles=vehicles,
            ticks=ticks,
            cycles=cycles,
            seed=seed,
            timeout_s=600.0 + ticks * 0.2 + cycles * 10.0,
        )
        phases.append(
            run_trial(
                load_trial, server.port, server.pid, loads=loads, timeout_s=300.0 + loads * 30.0
            )
        )
        files, count = open_files(server.pid), threads(server.pid)
    figures = [Figure("vehicles", vehicles), Figure("memory_at_start_mb", before_mb)]
    for phase in phases:
        figures += [
            Figure(phase.name, phase.steps),
            Figure(f"memory_settled_in_{phase.name}_mb", phase.settled_mb),
            Figure(f"memory_after_{phase.name}_mb", phase.samples_mb[-1]),
            Figure(f"largest_deviation_in_{phase.name}", phase.spread, "<=", FLAT),
        ]
    figures += [Figure("open_files_at_the_end", files), Figure("threads_at_the_end", count)]
    return Verdict("server-memory", tuple(figures))
