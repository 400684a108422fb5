"""Drives in one town after the other, each on a server of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.campaign import Campaign
from benchmarks.simulator.client_process import TrialError, run_trial
from benchmarks.simulator.server_process import running_server
from benchmarks.simulator.traffic.judging import judge
from benchmarks.simulator.traffic.recording import Recording
from benchmarks.simulator.traffic.trial import lone_vehicles_trial, traffic_trial
from carstage.bench.verdict import Verdict
from carstage.errors import ServerError

_START_TIMEOUT_S = 900.0
_WALL_PER_SIMULATED_S = 12.0
_LONE_VEHICLES = 20


def drive(
    town: str,
    *,
    vehicles: int,
    walkers: int,
    seconds: float,
    fps: int,
    seed: int,
    base_types: Sequence[str] = ("car",),
    lone_seconds: float = 60.0,
    server_arguments: Sequence[str] = (),
    save_to: Path | None = None,
) -> Recording:
    """Starts a server with a town, lets traffic flow, and returns what was seen.

    Raises:
        ServerError: the server did not start.
        TrialError: the drive failed or took too long.
    """
    arguments = ("--map", town, *server_arguments)
    lone = min(max(vehicles // 2, 1), _LONE_VEHICLES)
    with running_server(arguments, start_timeout_s=_START_TIMEOUT_S) as port:
        free_flow, with_lights = run_trial(
            lone_vehicles_trial,
            port,
            vehicles=lone,
            seconds=lone_seconds,
            fps=fps,
            seed=seed,
            base_types=tuple(base_types),
            timeout_s=300.0 + _WALL_PER_SIMULATED_S * lone_seconds,
        )
        recording = run_trial(
            traffic_trial,
            port,
            vehicles=vehicles,
            walkers=walkers,
            seconds=seconds,
            fps=fps,
            seed=seed,
            base_types=tuple(base_types),
            timeout_s=300.0 + _WALL_PER_SIMULATED_S * seconds,
        )
    recording = replace(recording, free_flow=free_flow, free_flow_with_lights=with_lights)
    if save_to is not None:
        recording.save(save_to)
    return recording


def check_traffic(
    towns: Sequence[str] = ("Stage01",),
    *,
    vehicles: int = 30,
    walkers: int = 0,
    seconds: float = 120.0,
    fps: int = 20,
    seed: int = 7,
    base_types: Sequence[str] = ("car",),
    lone_seconds: float = 60.0,
    server_arguments: Sequence[str] = (),
    save_in: Path | None = None,
) -> Campaign:
    """A verdict for each town; one that cannot be driven in does not keep the others from it.

    Args:
        towns: maps, in this order.
        vehicles, walkers, seconds, fps, seed, base_types: of the drive in each town.
        lone_seconds: simulated time in which free flow is measured.
        server_arguments: further arguments of the servers, such as ``--maps DIR``.
        save_in: folder for the recordings, made if missing; they are not kept without one.

    Raises:
        OSError: the folder cannot be made.
    """
    if save_in is not None:
        save_in.mkdir(parents=True, exist_ok=True)  # a drive takes long: refused before the first
    verdicts = []
    for number, town in enumerate(towns, 1):
        print(f"traffic in {town} ({number} of {len(towns)})", file=sys.stderr, flush=True)
        try:
            recording = drive(
                town,
                vehicles=vehicles,
                walkers=walkers,
                seconds=seconds,
                fps=fps,
                seed=seed,
                base_types=base_types,
                lone_seconds=lone_seconds,
                server_arguments=server_arguments,
                save_to=save_in / f"{town}.npz" if save_in is not None else None,
            )
        except (ServerError, TrialError) as error:
            verdicts.append(Verdict(f"traffic in {town}", (), (str(error),), completed=False))
        else:
            verdicts.append(judge(recording))
        print(verdicts[-1].text(), file=sys.stderr, flush=True)
    return Campaign("traffic", dict(zip(towns, verdicts, strict=True)))


def judge_saved(folder: Path) -> Campaign:
    """Verdicts on recordings that an earlier drive saved, without driving again."""
    recordings = [Recording.load(path) for path in sorted(folder.glob("*.npz"))]
    return Campaign("traffic", {recording.town: judge(recording) for recording in recordings})
