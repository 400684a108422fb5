"""The variants of an episode show one world: the same times, everybody at the same places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from carstage.annotation.schema import OBJECT_COLUMNS
from carstage.dataset.ledger import saved_times_s
from carstage.dataset.reading import Episode
from carstage.dataset.tracks import may_come_back
from carstage.dataset.variants import EpisodeVariants
from carstage.errors import CarStageError
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.table_schema import require_ledger, require_rows

SAME_M = 0.01
"""Places that are nearer than this count as the same: a pixel at 10 m of a camera with 1000 px."""
SAME_DEG = 0.1
_SAME_S = 1e-6
_NAMES = ("k", "track_id", "class", "is_static", "actor_location", "actor_rotation_deg")
_COLUMNS = [column for column in OBJECT_COLUMNS if column.name in _NAMES]


@dataclass(slots=True)
class VariantFigures:
    """What was compared: poses of actors, and how far those of variants lay apart at most."""

    groups: int = 0
    poses: int = 0
    largest_m: float = 0.0
    largest_deg: float = 0.0

    def to_dict(self) -> dict[str, float]:
        """For the report."""
        return {
            "groups": self.groups,
            "poses": self.poses,
            "largest_m": round(self.largest_m, 6),
            "largest_deg": round(self.largest_deg, 6),
        }


@dataclass(frozen=True, slots=True)
class _Poses:
    """Poses of those who move, sorted by frame and actor.

    Attributes:
        k: ``(N,)`` frames.
        ids: ``(N,)`` track ids.
        ranks: ``(N,)`` place of each actor in the order in which all were spawned. A rig with more
            sensors moves the ids of actors that come later, and not this order.
        poses: ``(N, 6)`` x, y, z (m), pitch, yaw, roll (deg) in the world.
    """

    k: NDArray[np.int64]
    ids: NDArray[np.int64]
    ranks: NDArray[np.int64]
    poses: NDArray[np.float64]


def check_variants(variants: EpisodeVariants, findings: Findings, figures: VariantFigures) -> None:
    """Compare every variant of an episode with the first one (check ``variants``).

    Only what the tables say of the world is compared. What sensors see may differ.

    Args:
        variants: of one episode.
        findings: where problems go.
        figures: what was compared, added to.
    """
    first, *others = variants.names
    try:
        times_s = saved_times_s(require_ledger(variants[first].ledger()))
        poses = _poses(variants[first])
    except CarStageError:
        return  # the checks of its files say so
    figures.groups += 1
    for name in others:
        try:
            other_times_s, other_poses = (
                saved_times_s(require_ledger(variants[name].ledger())),
                _poses(variants[name]),
            )
        except CarStageError:
            continue  # as above
        whose = f"variant {name} beside {first}: "
        if not _same_times(times_s, other_times_s):
            findings.add("variants", f"{whose}it has other frames, or other times")
        else:
            _compare(poses, other_poses, whose, findings, figures)


def _same_times(one: dict[int, float], other: dict[int, float]) -> bool:
    return one.keys() == other.keys() and all(abs(one[k] - other[k]) <= _SAME_S for k in one)


def _poses(episode: Episode) -> _Poses:
    """Where everybody was.

    Raises:
        DatasetError: a table is missing or damaged.
    """
    table = episode.objects()
    require_rows(table, _COLUMNS, "objects.parquet")
    table = table.filter(pa.array(~may_come_back(table)))
    k, ids = (table[name].to_numpy().astype(np.int64) for name in ("k", "track_id"))
    columns = (table[name].to_pylist() for name in ("actor_location", "actor_rotation_deg"))
    poses = [[*location, *rotation] for location, rotation in zip(*columns, strict=True)]
    _, ranks = np.unique(ids, return_inverse=True)
    order = np.lexsort((ids, k))
    found = np.array(poses, np.float64).reshape(-1, 6)
    return _Poses(k[order], ids[order], ranks[order], found[order])


def _compare(
    one: _Poses, other: _Poses, whose: str, findings: Findings, figures: VariantFigures
) -> None:
    """Report the first frame and actor that differ, and in how many poses they do."""
    count = min(len(one.k), len(other.k))
    same_actor = (one.k[:count] == other.k[:count]) & (one.ranks[:count] == other.ranks[:count])
    if not same_actor.all() or len(one.k) != len(other.k):
        at = int(np.argmin(same_actor)) if not same_actor.all() else count
        longer = one if len(one.k) > at else other
        message = f"{whose}actor {longer.ids[at]} is not in both"
        findings.add("variants", message, frame=int(longer.k[at]))
        return
    figures.poses += count
    if not count:
        return
    apart = np.abs(one.poses - other.poses)
    apart[:, 3:] = np.abs((apart[:, 3:] + 180.0) % 360.0 - 180.0)
    apart_m = np.linalg.norm(apart[:, :3], axis=1)
    apart_deg = apart[:, 3:].max(axis=1)
    figures.largest_m = max(figures.largest_m, float(apart_m.max()))
    figures.largest_deg = max(figures.largest_deg, float(apart_deg.max()))
    wrong = (apart_m > SAME_M) | (apart_deg > SAME_DEG)
    if wrong.any():
        at = int(np.argmax(wrong))
        findings.add(
            "variants",
            f"{whose}actor {one.ids[at]} is {apart_m[at]:.3g} m and {apart_deg[at]:.3g} degrees "
            f"apart, the first of {int(wrong.sum())} poses beyond {SAME_M:g} m or {SAME_DEG:g} "
            "degrees",
            frame=int(one.k[at]),
        )
