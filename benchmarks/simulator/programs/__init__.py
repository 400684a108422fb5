"""CARLA's own programs, unmodified, against the embedded simulator: how each is run and judged.

``catalogue`` says what each program needs, ``running`` runs one, ``smoke`` runs CARLA's smoke tests
by ``smoke_process``, ``check`` goes through a folder. The programs are the user's: none is here.
"""

from benchmarks.simulator.programs.check import check_programs

__all__ = ["check_programs"]
