"""Random faults over tiny runs: does every run end well, and is what it committed right?

``campaign`` draws and counts, ``trial`` runs and judges one fault, ``kinds`` are the faults,
``streams`` and ``disks`` what they need: a proxy before the server, disks that are full or slow.
``io_errors`` are faults of another campaign: single calls of the system that fail.
"""

from benchmarks.framework.faults.campaign import run_campaign, run_io_errors, table, table_text
from benchmarks.framework.faults.kinds import FAULTS

__all__ = ["FAULTS", "run_campaign", "run_io_errors", "table", "table_text"]
