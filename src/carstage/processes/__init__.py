"""A pool of processes that are forked from one that has loaded what they need.

``process_pool`` starts it. Conversion, exports and validation work in such processes.
"""

from __future__ import annotations

from carstage.processes.pool import BrokenPoolError, ProcessPool, process_pool
from carstage.processes.worker import NICENESS

__all__ = ["NICENESS", "BrokenPoolError", "ProcessPool", "process_pool"]
