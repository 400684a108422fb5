"""Measurements that anyone can repeat; each prints its figures beside their targets.

Run as modules, ``python -m carstage.bench.demo [--json]``; the recorded results stand in
``docs/benchmark.md``.
"""
