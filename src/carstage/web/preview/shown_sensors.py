"""The sensors of a recording as previews name them: an agent's with the agent's name before it."""

from __future__ import annotations

from typing import NamedTuple

from carstage.spec import EpisodeSpec, SensorSpec
from carstage.spec.agents import stream_of


class ShownSensor(NamedTuple):
    """A sensor that may be shown.

    Attributes:
        id: its id, of an agent's sensor ``AGENT.ID``.
        stream: of the raw log.
        sensor: its specification.
    """

    id: str
    stream: str
    sensor: SensorSpec


def shown_sensors(spec: EpisodeSpec) -> list[ShownSensor]:
    """The ego's sensors that a dataset has, then those of each agent."""
    found = [ShownSensor(one.id, one.id, one) for one in spec.written_sensors]
    for number, agent in enumerate(spec.agents, 1):
        found += [
            ShownSensor(f"{agent.name}.{one.id}", stream_of(one.id, number), one)
            for one in agent.sensors
            if not one.hidden
        ]
    return found
