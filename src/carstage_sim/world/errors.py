"""Refusals of the world, worded as CARLA words them."""

from __future__ import annotations


class WorldError(Exception):
    """A command that the world refuses."""


class SpawnError(WorldError):
    """An actor that cannot be spawned."""


class ActorNotFoundError(WorldError, KeyError):
    """An id that no live or lately destroyed actor has."""

    def __init__(self, actor_id: int) -> None:
        super().__init__(f"actor {actor_id} not found")

    def __str__(self) -> str:
        return str(self.args[0])
