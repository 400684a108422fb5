"""The simulated world: episode, actors, blueprints, dynamics, traffic lights, walkers, weather.

One thread owns it. A tick applies commands, steps the dynamics and freezes a ``WorldState``.
"""
