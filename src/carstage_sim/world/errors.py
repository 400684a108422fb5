"""Refusals of the world, worded as CARLA words them."""

from __future__ import annotations


class WorldError(Exception):
    """A command that the world refuses."""


class SpawnError(WorldError):
    """An actor that cannot be spawned."""


class ActorError(WorldError):
    """An actor that cannot do what is asked of it.

    Attributes:
        reason: what is wrong, in the words of CARLA's ``CarlaGetStringError``.
        actor_id: the actor.
    """

    def __init__(self, reason: str, actor_id: int) -> None:
        super().__init__(f"{reason}. Actor Id: {actor_id}")
        self.reason = reason
        self.actor_id = actor_id

    def __str__(self) -> str:
        return str(self.args[0])


class ActorNotFoundError(ActorError, KeyError):
    """An id that no live or lately destroyed actor has."""

    def __init__(self, actor_id: int) -> None:
        super().__init__("Actor could not be found in the registry", actor_id)


class ActorTypeError(ActorError, TypeError):
    """An actor of another kind than the call is for."""

    def __init__(
        self, actor_id: int, reason: str = "Actor does not match the expected type"
    ) -> None:
        super().__init__(reason, actor_id)
