"""The variants of one episode, frame by frame beside each other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from carstage.dataset.saved_frames import EpisodeFrames, Frame
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from carstage.dataset.reading import Episode


@dataclass(frozen=True)
class EpisodeVariants:
    """One episode as its variants recorded it: the same world at the same times.

    Attributes:
        base_id: id of the episode as it would be without any variant.
        episodes: by name of the variant, sorted by it.
    """

    base_id: str
    episodes: Mapping[str, Episode]
    _frames: dict[str, EpisodeFrames] = field(default_factory=dict, repr=False, compare=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variants, sorted."""
        return tuple(self.episodes)

    @property
    def frames(self) -> int:
        """Saved frames that all variants have."""
        return min(episode.frames for episode in self.episodes.values())

    def __getitem__(self, name: str) -> Episode:
        """The episode of one variant.

        Raises:
            BadInputError: there is none of that name.
        """
        if name not in self.episodes:
            raise BadInputError(
                f"Episode {self.base_id} has no variant {name!r}.",
                f"Variants: {', '.join(self.names)}.",
            )
        return self.episodes[name]

    def frame(self, k: int) -> dict[str, Frame]:
        """Frame ``k`` of every variant, by its name.

        Raises:
            DatasetError: a table is missing or damaged.
        """
        for name, episode in self.episodes.items():
            if name not in self._frames:
                self._frames[name] = EpisodeFrames(episode)
        return {name: self._frames[name].frame(k) for name in self.episodes}

    def iter_frames(self) -> Iterator[dict[str, Frame]]:
        """The frames one after the other, each as :meth:`frame` gives it.

        Raises:
            DatasetError: a table is missing or damaged.
        """
        return (self.frame(k) for k in range(self.frames))


def variants_of(episodes: Iterable[Episode]) -> tuple[EpisodeVariants, ...]:
    """Episodes that are variants of one another, together; those that are none are left out.

    Args:
        episodes: in any order.

    Raises:
        DatasetError: the document of one cannot be read.
    """
    groups: dict[str, dict[str, Episode]] = {}
    for episode in episodes:
        if episode.variant is not None:
            groups.setdefault(episode.base_id, {})[episode.variant] = episode
    return tuple(
        EpisodeVariants(base_id, dict(sorted(group.items())))
        for base_id, group in sorted(groups.items())
    )
