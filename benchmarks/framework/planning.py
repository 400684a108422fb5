"""What planning many episodes costs in CPU time and memory, from configuration to plan file.

A process of its own plans, estimates, writes ``plan.json`` and takes the first job, as a run does
before its server starts. CPU time counts, scaled by a calibration kernel; memory is the largest
resident set of the process, Python and all imports among it. A campaign that samples five settings
is measured beside it: each of its values is checked as one in a file is.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict

EPISODES = 100_000
_TARGET_CPU_S = 10.0
_TARGET_MB = 300.0
_PATIENCE_S = 1800.0

_PLAIN = """
name: plain
rig: {preset: demo}
map: {random_from: [all]}
weather: {random_from: [all]}
"""
_CAMPAIGN = """
name: sampled
rig: {preset: demo}
map: {choice: [Stage01, Stage02, Stage03]}
weather:
  choice: [ClearNoon, WetNoon, ClearNight]
  parameters: {fog_density: {normal: [20, 10], min: 0, max: 60}}
vehicles: {count: {range: [10, 50]}}
duration_s: {choice: [5, 10], weights: [3, 1]}
campaign: {method: latin_hypercube}
"""
_PROGRAM = """
import json, resource, sys, tempfile, time
from pathlib import Path
from carstage.config import parse_config
from carstage.plan import estimate_run, plan_episodes
from carstage.runs.folder import RunFolder
from carstage.runs.jobs import JobQueue
from carstage.runs.servers import embedded_facts

facts = embedded_facts("0.9.16")
config = parse_config(sys.argv[1], [f"episodes={sys.argv[2]}"])
started_s, started_wall_s = time.process_time(), time.perf_counter()
plan = plan_episodes(config, facts)
planned_s = time.process_time() - started_s
todo = plan.without(set(plan.ids[::2]))
estimate_run(config, todo)
with tempfile.TemporaryDirectory() as folder, RunFolder(Path(folder), "planning") as run:
    run.write_plan(config, plan, {})
    bytes_ = (run.path / "plan.json").stat().st_size
job = JobQueue(todo).popleft()
assert job.episode_id == plan.ids[1] and len(set(plan.ids)) == len(plan)
print(json.dumps({
    "plan_cpu_s": planned_s,
    "cpu_s": time.process_time() - started_s,
    "wall_s": time.perf_counter() - started_wall_s,
    "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
    "plan_json_mb": bytes_ / 1e6,
}))
"""


def measure_planning(episodes: int = EPISODES) -> Verdict:
    """Plan a plain configuration and a campaign, each in a process of its own.

    Args:
        episodes: of each; targets are for ``EPISODES`` and shrink with fewer.
    """
    share = episodes / EPISODES
    figures = [Figure("episodes", episodes)]
    for name, text in (("plain", _PLAIN), ("campaign", _CAMPAIGN)):
        before = slowness()
        measured = _measured(text, episodes)
        slow = max(1.0, (before + slowness()) / 2.0)
        judged = name == "plain"
        target_s = _TARGET_CPU_S * share if judged else None
        figures += [
            Figure(f"{name}_machine_slowness", slow),
            Figure(f"{name}_cpu_s", measured["cpu_s"]),
            Figure(f"{name}_cpu_scaled_s", measured["cpu_s"] / slow, "<=", target_s),
            Figure(f"{name}_plan_cpu_s", measured["plan_cpu_s"]),
            Figure(f"{name}_wall_s", measured["wall_s"]),
            Figure(f"{name}_peak_mb", measured["peak_mb"], "<=", _TARGET_MB),
            Figure(f"{name}_plan_json_mb", measured["plan_json_mb"]),
        ]
    notes = (
        "from the checked configuration to the first job, the run's plan.json written",
        "the campaign samples five settings by Latin hypercube; its time has no target",
    )
    return Verdict("planning", tuple(figures), notes)


def _measured(text: str, episodes: int) -> dict[str, Any]:
    ended = subprocess.run(
        [sys.executable, "-c", _PROGRAM, text, str(episodes)],
        stdout=subprocess.PIPE,
        text=True,
        timeout=_PATIENCE_S,
        check=True,
    )
    measured: dict[str, Any] = json.loads(ended.stdout.splitlines()[-1])
    return measured
