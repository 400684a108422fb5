"""Events on the ego's way: one module per kind; importing this fills the registry.

``runner`` steps them, ``base`` holds the seam, ``surroundings`` what they see and spawn, ``lanes``
what is beside a place, ``cars`` how their cars move, ``signals`` what lights show meanwhile,
``works_traffic`` how traffic gets past works.
"""

from carstage.collector.scenario.events import (
    crossing,
    cut_in,
    cyclist,
    emergency,
    leader,
    overtaker,
    red_light,
    stopped,
    works,
)
from carstage.collector.scenario.events.runner import EventRunner, check_map

__all__ = [
    "EventRunner",
    "check_map",
    "crossing",
    "cut_in",
    "cyclist",
    "emergency",
    "leader",
    "overtaker",
    "red_light",
    "stopped",
    "works",
]
