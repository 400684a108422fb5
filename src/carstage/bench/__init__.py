"""Measurements that anyone can repeat; each prints its figures and their targets.

``carstage bench NAME [--json]`` runs them. What measures Car-STAGE itself is not installed: see
``benchmarks/`` at the root of the repository.
"""
