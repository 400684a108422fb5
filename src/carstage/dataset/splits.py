"""Which episodes are for training, validation and test: the rule, and ``splits.json``."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, get_args

from carstage.errors import BadInputError, DatasetError, StoreAccessError
from carstage.files.bounded import read_bounded
from carstage.storage.remote_path import DatasetPath

Split = Literal["train", "val", "test"]
Criterion = Literal["map", "weather"]
SPLITS: Final[tuple[Split, ...]] = get_args(Split)
CRITERIA: Final[tuple[Criterion, ...]] = get_args(Criterion)
SPLITS_FILE: Final = "splits.json"
SPLITS_FORMAT: Final = 1

_MOST_BYTES = 16 << 20
"""Some 400,000 episodes."""
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,127}")
_MOST_SEED = 2**63


@dataclass(frozen=True, slots=True)
class SplitRule:
    """How episodes are divided; what is neither validation nor test is training.

    Attributes:
        val: share of the episodes for validation, from 0 to below 1.
        test: share for test, likewise.
        seed: another one gives another draw.
        stratify: what each split shall have in equal shares: maps, weather presets.

    Raises:
        BadInputError: a value is out of range.
    """

    val: float = 0.0
    test: float = 0.0
    seed: int = 0
    stratify: tuple[Criterion, ...] = ()

    def __post_init__(self) -> None:
        for name, share in (("val", self.val), ("test", self.test)):
            if not 0.0 <= share < 1.0:
                raise BadInputError(
                    f"{name}: {share} is no share.", "Give a number from 0 to below 1."
                )
        if self.val + self.test >= 1.0:
            raise BadInputError(
                f"val and test: {self.val} and {self.test} leave nothing for training.",
                "Give shares whose sum is below 1.",
            )
        if not 0 <= self.seed < _MOST_SEED:
            raise BadInputError(f"seed: {self.seed} is no seed.", "Give 0 or more, below 2**63.")
        for name in self.stratify:
            if name not in CRITERIA:
                raise BadInputError(
                    f"stratify: {name!r} is unknown.", f"Give {' or '.join(CRITERIA)}."
                )

    @property
    def wanted(self) -> tuple[Split, ...]:
        """The splits that have to have an episode."""
        shares = {"train": 1.0, "val": self.val, "test": self.test}
        return tuple(split for split in SPLITS if shares[split] > 0.0)

    def draw(self, strata: Mapping[str, str]) -> dict[str, Split]:
        """The split of each episode.

        The numbers of episodes follow the shares by largest remainder, one at least for each split
        that is asked for. Each stratum gets about its part of every split.

        Args:
            strata: what episodes are alike in, by their ids.

        Raises:
            BadInputError: there are fewer episodes than splits.
        """
        counts = self._counts(len(strata))
        order = sorted(strata, key=lambda name: (self._hash(strata[name]), self._hash(name)))
        drawn: dict[str, Split] = {}
        given = Counter[Split]()
        for place, name in enumerate(order, 1):
            # The split that lags most behind its share of the episodes so far; neighbours, so the
            # episodes of a stratum, are shared out evenly, and in the end the counts are met.
            lags = {s: counts[s] * place - given[s] * len(order) for s in self.wanted}
            split = max(self.wanted, key=lags.__getitem__)
            given[split] += 1
            drawn[name] = split
        return {name: drawn[name] for name in sorted(drawn)}

    def later(self, episode_id: str) -> Split:
        """The split of an episode that was recorded after the draw: by its hash alone."""
        place = int.from_bytes(self._hash(episode_id)[:8], "big") / 2**64
        if place < self.test:
            return "test"
        return "val" if place < self.test + self.val else "train"

    def _hash(self, text: str) -> bytes:
        return hashlib.sha256(f"{self.seed}:{text}".encode()).digest()

    def _counts(self, episodes: int) -> dict[Split, int]:
        """Episodes by split."""
        if episodes < len(self.wanted):
            raise BadInputError(
                f"{episodes} episode{'s' * (episodes != 1)} cannot fill {len(self.wanted)} splits "
                f"({', '.join(self.wanted)}).",
                "Record more episodes, or give fewer of the shares for val and test.",
            )
        # Through decimal digits: 0.7 of 10 episodes are 7, not 6.999….
        exact = {"val": round(self.val * episodes, 9), "test": round(self.test * episodes, 9)}
        exact["train"] = episodes - exact["val"] - exact["test"]
        counts = {split: math.floor(exact[split] + 1e-9) for split in self.wanted}
        rest = sorted(self.wanted, key=lambda split: counts[split] - exact[split])
        for split in rest[: episodes - sum(counts.values())]:
            counts[split] += 1
        for split in self.wanted:
            if counts[split] == 0:
                counts[max(self.wanted, key=counts.__getitem__)] -= 1
                counts[split] = 1
        return counts


@dataclass(frozen=True, slots=True)
class StoredSplits:
    """What ``splits.json`` says.

    Attributes:
        rule: how they were drawn.
        episodes: the split by the id of each episode that there was.
        variants: the split of all variants of an episode, by their ``base_id``.
    """

    rule: SplitRule
    episodes: Mapping[str, Split]
    variants: Mapping[str, Split] = field(default_factory=dict)

    def of(self, episode_id: str, base_id: str) -> Split:
        """The split of an episode; one that was recorded later is given one by the rule's seed.

        Args:
            episode_id: of the episode.
            base_id: what its variants have in common; its own id where it has none.
        """
        known = self.episodes.get(episode_id) or self.variants.get(base_id)
        return known or self.rule.later(base_id)

    def lost(self, present: Collection[str]) -> tuple[str, ...]:
        """Ids of which the dataset has no episode."""
        return tuple(name for name in self.episodes if name not in present)

    def to_bytes(self) -> bytes:
        """The content of the file; equal splits give equal bytes."""
        document: dict[str, Any] = {
            "format_version": SPLITS_FORMAT,
            "seed": self.rule.seed,
            "shares": {"val": self.rule.val, "test": self.rule.test},
            "stratify": list(self.rule.stratify),
            "episodes": dict(sorted(self.episodes.items())),
        }
        if self.variants:
            document["variants"] = dict(sorted(self.variants.items()))
        return (json.dumps(document, indent=1) + "\n").encode()


def read_splits(folder: DatasetPath) -> StoredSplits | None:
    """The splits of the dataset in ``folder``; ``None``: none were made.

    Raises:
        DatasetError: the file is too large, damaged, or of another format version.
        StoreAccessError: the object store lets nobody look.
    """
    path = folder / SPLITS_FILE
    hint = "Make it again: carstage split DATASET --overwrite."
    try:
        content = read_bounded(path, _MOST_BYTES)
        return _parse(json.loads(content, object_pairs_hook=_object))
    except FileNotFoundError as error:
        if isinstance(path, Path) and path.is_symlink():
            raise DatasetError(f"{path} is a link to nothing.", hint) from error
        return None
    except StoreAccessError:  # a ValueError, too; it says nothing of the file
        raise
    except OSError as error:
        reason = f"it is no file of a fitting size: {error.strerror}"
        raise DatasetError(f"{path} cannot be read: {reason}.", hint) from error
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{path} cannot be read: {error}.", hint) from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key stands there twice")
    return found


def _parse(document: Any) -> StoredSplits:
    """Check everything.

    Raises:
        ValueError: it is no such document.
    """
    keys = {"format_version", "seed", "shares", "stratify", "episodes"}
    _require(isinstance(document, dict) and keys <= set(document), f"it needs {sorted(keys)}")
    version, seed, shares = (document[key] for key in ("format_version", "seed", "shares"))
    _require(version == SPLITS_FORMAT, f"format version {version!r:.40}, not {SPLITS_FORMAT}")
    _require(type(seed) is int, "seed is no whole number")
    _require(
        isinstance(shares, dict)
        and set(shares) == {"val", "test"}
        and all(type(share) in (int, float) for share in shares.values()),
        "shares needs the numbers val and test",
    )
    stratify, episodes = document["stratify"], document["episodes"]
    _require(
        isinstance(stratify, list) and all(name in CRITERIA for name in stratify),
        f"stratify is no list of {' and '.join(CRITERIA)}",
    )
    variants = document.get("variants", {})
    for key, drawn in (("episodes", episodes), ("variants", variants)):
        _require(isinstance(drawn, dict), f"{key} is no object")
        for name, split in drawn.items():
            _require(_ID.fullmatch(name) is not None, f"{name!r:.40} is no id of an episode")
            _require(split in SPLITS, f"episode {name}: {split!r:.40} is no split")
    rule = SplitRule(shares["val"], shares["test"], seed, tuple(stratify))
    return StoredSplits(rule, episodes, variants)


def _require(holds: bool, words: str) -> None:
    if not holds:
        raise ValueError(words)
