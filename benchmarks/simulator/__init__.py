"""Checks of a running simulator by the real client: traffic, determinism, pedestrians.

``python -m benchmarks.simulator NAME`` starts a server as a process, drives it with the unmodified
``carla`` wheel, compares figures with their targets and exits 0 or 1.
"""
