"""Generated traffic against a server while a healthy client works: who is harmed?

Requests are mutations of valid ones, for every call that the server knows; connections misbehave in
all ways that a dying, hanging or wrong program can be.
"""

from benchmarks.simulator.fuzz.campaign import check_fuzz

__all__ = ["check_fuzz"]
