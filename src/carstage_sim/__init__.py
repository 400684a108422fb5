"""The embedded simulator: a headless world server that speaks CARLA's wire protocol.

The real, unmodified ``carla`` client wheel drives it. Nothing here imports ``carstage``.
"""
