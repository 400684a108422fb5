"""How an episode is stepped: synchronisation, physics sub-steps, incomplete frames."""

from __future__ import annotations

from math import ceil
from typing import Literal, NamedTuple

from carstage.config.fields import Section, problem, setting

#: CARLA's bounds of physics sub-steps (documentation of the synchronous mode and the time step).
MAX_SUBSTEPS = 16
PREFERRED_SUBSTEP_S = 0.01
_SLACK_S = 1e-9


class Substepping(NamedTuple):
    """Physics sub-steps within one step of the world."""

    max_substep_delta_time_s: float
    max_substeps: int


class ExplicitSubstepping(Section):
    """A pair for `timing.substepping`; their product must reach the time step, 1 / fps."""

    max_substep_delta_time_s: float = setting(
        PREFERRED_SUBSTEP_S,
        title="Longest sub-step",
        description="Longest physics sub-step.",
        unit="s",
        group="timing",
        gt=0,
        le=1,
    )
    max_substeps: int = setting(
        10,
        title="Sub-steps",
        description="Most physics sub-steps of one step.",
        group="timing",
        ge=1,
        le=MAX_SUBSTEPS,
    )


class Timing(Section):
    """Synchronisation and physics time."""

    mode: Literal["sync", "async"] = setting(
        "sync",
        title="Mode",
        description="`sync`: the server steps when the recorder says so; `async`: it runs freely.",
        group="timing",
    )
    sensor_sync: bool = setting(
        True,
        title="Sensors in step",
        description="Every sensor measures every step, and a frame waits for all. `false`: "
        "sensors may have a rate_hz of their own.",
        group="timing",
    )
    substepping: Literal["auto"] | ExplicitSubstepping = setting(
        "auto",
        title="Sub-stepping",
        description="Physics sub-steps; `auto` chooses them so that they reach 1 / fps.",
        group="timing",
    )
    on_incomplete: Literal["wait", "skip"] = setting(
        "wait",
        title="Incomplete frames",
        description="`wait`: wait for late sensors, record why; `skip`: go on (the paper's way).",
        group="timing",
    )
    warmup_ticks: int = setting(
        20,
        title="Warm-up",
        description="Steps before the first that is recorded.",
        unit="steps",
        group="timing",
        ge=0,
        le=10_000,
    )

    def substeps(self, fps: float) -> Substepping:
        """The sub-steps at ``fps``: the explicit ones, or as many of 10 ms as a step needs."""
        if isinstance(self.substepping, ExplicitSubstepping):
            return Substepping(
                self.substepping.max_substep_delta_time_s, self.substepping.max_substeps
            )
        step_s = 1.0 / fps
        count = min(MAX_SUBSTEPS, max(10, ceil(step_s / PREFERRED_SUBSTEP_S - _SLACK_S)))
        return Substepping(max(PREFERRED_SUBSTEP_S, step_s / count), count)

    def reaches(self, fps: float) -> bool:
        """Whether the sub-steps can fill one step at ``fps``."""
        longest_s, count = self.substeps(fps)
        return 1.0 / fps <= longest_s * count + _SLACK_S


def check_substepping(timing: Timing, fps: float) -> None:
    """Refuse explicit sub-steps that cannot fill a step.

    Source: CARLA's documentation: fixed_delta_seconds <= max_substep_delta_time * max_substeps.

    Raises:
        PydanticCustomError: they cannot.
    """
    if not timing.reaches(fps):
        longest_s, count = timing.substeps(fps)
        raise problem(
            f"{count} sub-steps of at most {longest_s:g} s do not fill a step of {1.0 / fps:g} s.",
            f"Use `auto`, or max_substeps of at least {ceil(1.0 / fps / longest_s - _SLACK_S)}.",
            "timing",
            "substepping",
        )
