"""Measurements that anyone can repeat; each prints its figures beside their targets.

``carstage bench NAME [--json]`` runs them, ``python -m carstage.bench.demo [--json]`` the demo; the
recorded results stand in ``docs/benchmark.md``.
"""
