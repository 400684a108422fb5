"""Events on the ego's way: one module per kind; importing this fills the registry.

``runner`` steps them, ``base`` holds the seam, ``surroundings`` what they see and spawn, ``lanes``
what is beside a place, ``cars`` how their cars move.
"""

from carstage.collector.scenario.events import (
    crossing,
    cut_in,
    cyclist,
    emergency,
    leader,
    overtaker,
    stopped,
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
    "stopped",
]
