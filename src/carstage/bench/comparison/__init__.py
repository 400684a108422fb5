"""Car-STAGE compared with other ways to record: the experiments of the paper, by one command.

A ``Preset`` sets how much is measured; ``plan_trials`` lists every run of every program, programs
taking turns; ``Campaign`` makes them on one server and keeps each result at once, so that it goes
on where it ended; ``judge`` and ``write_report`` show the outcome.
"""

from carstage.bench.comparison.campaign import Campaign
from carstage.bench.comparison.judging import judge
from carstage.bench.comparison.presets import EXPERIMENTS, PRESETS, Preset
from carstage.bench.comparison.report import write_report
from carstage.bench.comparison.trials import Trial, TrialResult, plan_trials

__all__ = [
    "EXPERIMENTS",
    "PRESETS",
    "Campaign",
    "Preset",
    "Trial",
    "TrialResult",
    "judge",
    "plan_trials",
    "write_report",
]
