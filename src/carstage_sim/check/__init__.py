"""Check commands, ``python -m carstage_sim.check NAME [--json]``: the real client against a server.

Each runs in its own process, may import ``carla`` and prints figures beside their targets.
"""
