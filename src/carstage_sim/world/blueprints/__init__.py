"""The blueprint library: CARLA's ids, attributes and sizes as tables, one module per family.

:func:`catalogue` is the whole library; only what the simulator really produces is listed.
"""

from carstage_sim.world.blueprints.catalogue import catalogue
from carstage_sim.world.blueprints.model import Attribute, AttributeType, Blueprint
from carstage_sim.world.blueprints.sensors import add_sensor, sent_as

__all__ = ["Attribute", "AttributeType", "Blueprint", "add_sensor", "catalogue", "sent_as"]
