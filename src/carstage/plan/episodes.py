"""The episodes of a plan: their ids and costs at once, the rest of each when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from carstage.spec import EpisodeSpec


class EpisodePlan(Sequence[EpisodeSpec]):
    """A sequence of specifications that holds none of them.

    A hundred thousand specifications take more memory than a run needs for all else. So the plan
    keeps what everybody asks of each (a few numbers), and makes the others anew.

    Args:
        make: makes the specification of an index of the configuration; always the same.
        indices: of the episodes, in order.
        ids: their ids, in the same order.
        costs: ``(N,)`` of ``carstage.plan.estimate.COST``, in the same order.
    """

    def __init__(
        self,
        make: Callable[[int], EpisodeSpec],
        indices: NDArray[np.int64],
        ids: tuple[str, ...],
        costs: NDArray[Any],
    ) -> None:
        self._make = make
        self._indices = indices
        self.ids = ids
        self.costs = costs

    @classmethod
    def empty(cls) -> EpisodePlan:
        """A plan of no episode."""
        from carstage.plan.estimate import costs_of

        return cls(_no_episode, np.zeros(0, np.int64), (), costs_of(()))

    def __len__(self) -> int:
        return len(self.ids)

    @overload
    def __getitem__(self, position: int) -> EpisodeSpec: ...

    @overload
    def __getitem__(self, position: slice) -> EpisodePlan: ...

    def __getitem__(self, position: int | slice) -> EpisodeSpec | EpisodePlan:
        if isinstance(position, slice):
            return EpisodePlan(
                self._make, self._indices[position], self.ids[position], self.costs[position]
            )
        spec = self._make(int(self._indices[position]))
        spec.__dict__["episode_id"] = self.ids[position]  # its cached property; hashing takes long
        return spec

    def __iter__(self) -> Iterator[EpisodeSpec]:
        return (self[position] for position in range(len(self)))

    def __eq__(self, other: object) -> bool:
        if isinstance(other, EpisodePlan):
            return self.ids == other.ids
        if isinstance(other, Sequence):
            return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))
        return NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<EpisodePlan of {len(self)} episodes>"

    def without(self, present: Container[str]) -> EpisodePlan:
        """The episodes whose id is not among some.

        Args:
            present: ids.
        """
        kept = [position for position, one in enumerate(self.ids) if one not in present]
        return EpisodePlan(
            self._make,
            self._indices[kept],
            tuple(self.ids[position] for position in kept),
            self.costs[kept],
        )

    @property
    def indices(self) -> NDArray[np.int64]:
        """``(N,)``: number of each episode in its configuration, from 0."""
        return self._indices

    @property
    def frames(self) -> int:
        """Saved frames of all episodes."""
        return int(self.costs["frames"].sum())


def _no_episode(index: int) -> EpisodeSpec:
    raise IndexError(f"an empty plan has no episode {index}")
