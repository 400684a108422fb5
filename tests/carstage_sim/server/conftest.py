"""A served simulation, and the gate that its cameras pass."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from carstage_sim.sensors.cameras import HitCamera
from carstage_sim.simulation import Simulation
from held_drawing import SYNCHRONOUS, Gate, Rig


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[Gate]:
    gate, measure = Gate(), HitCamera.measure

    def gated(*arguments: Any) -> Any:
        gate.pass_through()
        return measure(*arguments)

    monkeypatch.setattr(HitCamera, "measure", gated)
    yield gate
    gate.open.set()


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    with Simulation("Stage01", threads=1) as running:
        running.warm_up()
        yield running


@pytest.fixture
def rig(simulation: Simulation, gate: Gate) -> Iterator[Rig]:
    with ExitStack() as resources:
        resources.callback(gate.open.set)
        simulation.apply_settings(SYNCHRONOUS)
        yield Rig(simulation, resources)
