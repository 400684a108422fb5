"""Writes the built-in towns: plans of streets in, OpenDRIVE text out.

Nothing here knows the client or the bake; what the bake needs stands in the text.
"""

from __future__ import annotations

from carstage_sim.maps.writer.layout import build_network
from carstage_sim.maps.writer.opendrive_text import write_opendrive
from carstage_sim.maps.writer.plan import TownPlan
from carstage_sim.maps.writer.stage01 import STAGE01
from carstage_sim.maps.writer.stage02 import STAGE02
from carstage_sim.maps.writer.stage03 import STAGE03

__all__ = ["PLANS", "opendrive_of"]

PLANS: dict[str, TownPlan] = {plan.name: plan for plan in (STAGE01, STAGE02, STAGE03)}


def opendrive_of(plan: TownPlan) -> str:
    """The OpenDRIVE text of a plan; equal plans give equal text."""
    return write_opendrive(build_network(plan))
