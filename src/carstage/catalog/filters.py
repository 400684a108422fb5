"""Which episodes are wanted; also without a database."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class PageFilter:
    """Which episodes; all that is given has to hold.

    Attributes:
        town: name of the map.
        weather: weather preset.
        split: ``train``, ``val`` or ``test``.
        sensor: kind of a sensor that the rig has, such as ``lidar``.
        variant: name of the variant that the episode is.
        label: class of which there is an object in the episode, such as ``walker_adult``.
    """

    town: str | None = None
    weather: str | None = None
    split: str | None = None
    sensor: str | None = None
    variant: str | None = None
    label: str | None = None

    @property
    def is_empty(self) -> bool:
        """Whether it lets every episode pass."""
        return all(getattr(self, one.name) is None for one in fields(self))


EVERYTHING = PageFilter()
