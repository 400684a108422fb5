"""How time runs in an episode, and which of its steps are saved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

from carstage.spec.fields import Fields, SpecError
from carstage.spec.values import Value

_SLACK = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class TimingSpec(Value):
    """Synchronisation and physics time.

    Attributes:
        mode: ``sync``: the recorder steps the server; ``async``: the server runs on its own.
        sensor_sync: every sensor measures in every step.
        max_substep_delta_time_s: longest physics sub-step (s).
        max_substeps: most physics sub-steps of one step.
        on_incomplete: ``wait`` for late sensors, or ``skip``.
    """

    mode: str
    sensor_sync: bool
    max_substep_delta_time_s: float
    max_substeps: int
    on_incomplete: str

    @classmethod
    def read(cls, fields: Fields, step_s: float) -> TimingSpec:
        """Check and read the section; ``step_s`` is what the sub-steps have to cover."""
        substep_s = fields.number("max_substep_delta_time_s", 0.0)
        substeps = fields.integer("max_substeps", 1)
        # At least as much slack as configurations have: what they take must be read again.
        if step_s > substep_s * substeps * (1.0 + _SLACK) + _SLACK:
            raise SpecError(
                "%s: %d sub-steps of %g s do not cover a step of %g s."
                % (fields.path("max_substeps"), substeps, substep_s, step_s),
                "Raise max_substeps or max_substep_delta_time_s.",
            )
        return cls(
            mode=fields.text("mode", ("sync", "async")),
            sensor_sync=fields.flag("sensor_sync"),
            max_substep_delta_time_s=substep_s,
            max_substeps=substeps,
            on_incomplete=fields.text("on_incomplete", ("wait", "skip")),
        )

    @property
    def synchronous(self) -> bool:
        """Whether the recorder steps the server; else it follows."""
        return self.mode == "sync"

    @property
    def demands_all(self) -> bool:
        """Whether every sensor has to deliver in every step."""
        return self.synchronous and self.sensor_sync and self.on_incomplete == "wait"


@dataclass(frozen=True, eq=False, repr=False)
class SavedSteps(Value):
    """The one rule for which steps are saved: 0, n, 2n, …

    Attributes:
        every: n; 1 saves every step.
    """

    every: int

    def index(self, step: int) -> Optional[int]:
        """Index ``k`` of the saved frame that a step becomes; None when it is not saved."""
        return step // self.every if step % self.every == 0 else None

    def step(self, k: int) -> int:
        """The step of saved frame ``k``."""
        return k * self.every

    def count(self, steps: int) -> int:
        """How many of the first ``steps`` steps are saved."""
        return -(-steps // self.every)


class SavedFrames:
    """``SavedSteps`` where the server runs on its own and steps may be missed.

    Where every step is seen, the same steps are saved. Where one that is due was missed, the first
    that is seen after it is saved instead.
    """

    def __init__(self, saved: SavedSteps) -> None:
        self._every = saved.every
        self._due = 0
        self._count = 0

    def index(self, step: int) -> Optional[int]:
        """Saved-frame index ``k`` of a step; None when it is not saved."""
        if step < self._due:
            return None
        self._due = (step // self._every + 1) * self._every
        self._count += 1
        return self._count - 1
