"""Every disk that a power cut can leave behind of a run: do readers and the next run cope?

``calls`` reads from a log of ``strace`` what a run did to its files, ``disk`` rebuilds what is on
the disk after each of these operations, and ``campaign`` opens it and goes on with it.
"""

from benchmarks.framework.crash_states.campaign import measure_crash_states, to_json

__all__ = ["measure_crash_states", "to_json"]
