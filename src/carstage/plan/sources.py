"""What an episode may follow beside its configuration."""

from __future__ import annotations

from typing import TypeAlias

from carstage.plan.drivers import Drive
from carstage.plan.scenario import Recording, ScenarioProgram

Source: TypeAlias = Recording | Drive | ScenarioProgram
"""A recorded episode or log, the commands of one, or a program for another tool."""
