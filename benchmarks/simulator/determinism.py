"""Are two runs the same? Hashes of every frame as the client sees it, compared tick by tick."""

from __future__ import annotations

import hashlib
import struct

import carla

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import running_server
from benchmarks.simulator.session import spawn_traffic, spawn_walkers, synchronous_session
from carstage.bench.verdict import Figure, Verdict


def frame_digest(snapshot: carla.WorldSnapshot, lights: list[carla.TrafficLight]) -> str:
    """sha256 of one frame: number, time, all actors' motion in id order, all lights' states."""
    digest = hashlib.sha256(struct.pack("<Qd", snapshot.frame, snapshot.timestamp.elapsed_seconds))
    for state in sorted(snapshot, key=lambda state: int(state.id)):
        transform = state.get_transform()
        place, turn = transform.location, transform.rotation
        velocity, spin = state.get_velocity(), state.get_angular_velocity()
        push = state.get_acceleration()
        digest.update(
            struct.pack(
                "<I15f",
                state.id,
                *(place.x, place.y, place.z, turn.pitch, turn.yaw, turn.roll),
                *(velocity.x, velocity.y, velocity.z, spin.x, spin.y, spin.z),
                *(push.x, push.y, push.z),
            )
        )
    digest.update(bytes(int(light.get_state()) for light in lights))
    return digest.hexdigest()


def determinism_trial(
    port: int, *, vehicles: int, walkers: int, ticks: int, fps: int, seed: int
) -> list[str]:
    """The digests of one try, one per tick; runs in the client's process."""
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        spawn_traffic(session, vehicles)
        if walkers:
            spawn_walkers(session, walkers)
        actors = session.world.get_actors().filter("traffic.traffic_light")
        lights = sorted(actors, key=lambda light: int(light.id))
        digests = []
        for _ in range(ticks):
            session.clock.tick()
            digests.append(frame_digest(session.world.get_snapshot(), lights))
        return digests


def check_determinism(
    *,
    ticks: int = 500,
    vehicles: int = 50,
    walkers: int = 10,
    fps: int = 20,
    seed: int = 7,
    tries: int = 2,
    server_arguments: tuple[str, ...] = (),
) -> Verdict:
    """Runs the same scene on fresh servers with fresh clients and compares every frame."""
    runs = []
    for _ in range(tries):
        with running_server(server_arguments) as port:
            runs.append(
                run_trial(
                    determinism_trial,
                    port,
                    vehicles=vehicles,
                    walkers=walkers,
                    ticks=ticks,
                    fps=fps,
                    seed=seed,
                    timeout_s=120.0 + ticks * 0.5,
                )
            )
    equal = [all(run[tick] == runs[0][tick] for run in runs) for tick in range(ticks)]
    first = "none" if all(equal) else str(equal.index(False))
    whole = hashlib.sha256("".join(runs[0]).encode()).hexdigest()
    return Verdict(
        "determinism",
        (
            Figure("tries", tries),
            Figure("vehicles", vehicles),
            Figure("walkers", walkers),
            Figure("identical_ticks", sum(equal), "==", ticks),
            Figure("distinct_frames", len(set(runs[0])), "==", ticks),
            Figure("first_differing_tick", first, "==", "none"),
            Figure("sha256", whole),
        ),
    )
