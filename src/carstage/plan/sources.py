"""What an episode may follow beside its configuration."""

from __future__ import annotations

from typing import TypeAlias

from carstage.plan.drivers import Drive
from carstage.plan.scenario import Recording, ScenarioProgram, Storyboard

Source: TypeAlias = Recording | Drive | ScenarioProgram | Storyboard
"""A recorded episode or log, the commands of one, a program for another tool, a storyboard."""
