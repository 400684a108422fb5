"""Splits of a dataset: drawn by a seed, stored, the same for every reader."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from analytic_dataset import bare_dataset
from carstage.cli.app import app
from carstage.dataset import Dataset, SplitRule, split_dataset
from carstage.dataset.splits import SPLITS
from carstage.errors import BadInputError, DatasetError
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.splits import check_splits


def ids(count: int) -> list[str]:
    return [f"{number:016x}" for number in range(count)]


def bare(folder: Path, count: int) -> Path:
    """Every second episode on another map, every fifth in another weather."""
    return bare_dataset(
        folder,
        {name: "WetNoon" if n % 5 == 0 else "ClearNoon" for n, name in enumerate(ids(count))},
        maps={name: f"Town{n % 2}" for n, name in enumerate(ids(count))},
    )


def invoke(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def counted(rule: SplitRule, count: int) -> dict[str, int]:
    return dict(Counter(rule.draw(dict.fromkeys(ids(count), "")).values()))


@pytest.mark.parametrize(
    ("count", "val", "test", "expected"),
    [
        (10, 0.2, 0.1, {"train": 7, "val": 2, "test": 1}),
        (10, 0.3, 0.0, {"train": 7, "val": 3}),
        (7, 0.2, 0.1, {"train": 5, "val": 1, "test": 1}),
        (3, 0.01, 0.01, {"train": 1, "val": 1, "test": 1}),
        (3, 0.6, 0.39, {"train": 1, "val": 1, "test": 1}),
        (2, 0.9, 0.0, {"train": 1, "val": 1}),
        (100, 0.29, 0.29, {"train": 42, "val": 29, "test": 29}),
    ],
)
def test_every_split_that_is_asked_for_has_its_share_and_an_episode(
    count: int, val: float, test: float, expected: dict[str, int]
) -> None:
    assert counted(SplitRule(val, test), count) == expected


@pytest.mark.parametrize(("count", "val", "test"), [(0, 0.2, 0.0), (1, 0.2, 0.0), (2, 0.2, 0.1)])
def test_fewer_episodes_than_splits_are_refused(count: int, val: float, test: float) -> None:
    with pytest.raises(BadInputError, match="cannot fill"):
        counted(SplitRule(val, test), count)


def test_a_draw_follows_from_seed_and_ids_alone() -> None:
    strata = dict.fromkeys(ids(40), "")
    drawn = SplitRule(0.2, 0.1).draw(strata)
    assert SplitRule(0.2, 0.1).draw(dict(reversed(strata.items()))) == drawn
    assert SplitRule(0.2, 0.1, seed=1).draw(strata) != drawn


def test_strata_are_shared_out_evenly() -> None:
    strata = {name: f"town {n % 4}" for n, name in enumerate(ids(40))}
    drawn = SplitRule(0.2, 0.1, seed=3, stratify=("map",)).draw(strata)
    for town in set(strata.values()):
        found = Counter(split for name, split in drawn.items() if strata[name] == town)
        assert found == {"train": 7, "val": 2, "test": 1}
    plain = SplitRule(0.2, 0.1, seed=3).draw(dict.fromkeys(strata, ""))
    towns = Counter(strata[name] for name, split in plain.items() if split == "val")
    assert set(towns.values()) != {2}  # without strata chance decides


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"val": 1.0}, "val: 1.0"),
        ({"test": -0.1}, "test: -0.1"),
        ({"val": float("nan")}, "val: nan"),
        ({"val": 0.5, "test": 0.5}, "nothing for training"),
        ({"seed": -1}, "seed"),
        ({"stratify": ("town",)}, "stratify: 'town'"),
    ],
)
def test_impossible_rules_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInputError, match=message):
        SplitRule(**values)


def test_the_command_stores_splits_that_readers_use(tmp_path: Path) -> None:
    folder = bare(tmp_path / "data", 20)
    ended = invoke(
        "split", folder, "--val", 0.2, "--test", 0.1, "--stratify", "map,weather", "--json"
    )
    assert ended.exit_code == 0, ended.stderr
    assert json.loads(ended.stdout)["episodes"] == {"train": 14, "val": 4, "test": 2}
    dataset = Dataset(folder)
    parts = {name: [episode.id for episode in dataset.split(name)] for name in SPLITS}
    assert sorted(name for part in parts.values() for name in part) == ids(20)
    assert {name: len(part) for name, part in parts.items()} == {"train": 14, "val": 4, "test": 2}
    assert Counter(dataset.episode(name).spec.map for name in parts["val"]) == {
        "Town0": 2, "Town1": 2
    }  # fmt: skip
    document = json.loads((folder / "splits.json").read_text())
    assert document["shares"] == {"val": 0.2, "test": 0.1}
    assert document["stratify"] == ["map", "weather"]


def test_stored_splits_are_replaced_on_demand_alone(tmp_path: Path) -> None:
    folder = bare(tmp_path / "data", 10)
    assert invoke("split", folder, "--val", 0.2).exit_code == 0
    before = (folder / "splits.json").read_bytes()
    refused = invoke("split", folder, "--val", 0.4)
    assert refused.exit_code == 2
    assert "--overwrite" in refused.stderr
    assert (folder / "splits.json").read_bytes() == before
    assert invoke("split", folder, "--val", 0.4, "--overwrite").exit_code == 0
    assert len(Dataset(folder).split("val")) == 4
    assert invoke("split", folder, "--val", 0.2, "--overwrite").exit_code == 0
    assert (folder / "splits.json").read_bytes() == before


def test_a_command_without_shares_is_refused(tmp_path: Path) -> None:
    refused = invoke("split", bare(tmp_path / "data", 3))
    assert refused.exit_code == 2
    assert "--val" in refused.stderr


def test_later_episodes_join_by_their_hash_and_move_nobody(tmp_path: Path) -> None:
    folder = bare(tmp_path / "data", 10)
    split_dataset(folder, SplitRule(val=0.3, test=0.3, seed=5))
    before = Dataset(folder).splits()
    bare(tmp_path / "other", 210)
    later = tmp_path / "other"
    (later / "splits.json").write_bytes((folder / "splits.json").read_bytes())
    after = Dataset(later).splits()
    assert {name: after[name] for name in before} == before
    joined = Counter(split for name, split in after.items() if name not in before)
    assert all(40 <= joined[split] <= 100 for split in SPLITS)  # of 200, 60 to 80 are expected


def test_an_empty_split_is_never_an_empty_answer(tmp_path: Path) -> None:
    folder = bare(tmp_path / "data", 3)
    assert set(Dataset(folder).splits().values()) == {"train"}
    assert len(Dataset(folder).split("train")) == 3
    with pytest.raises(BadInputError, match="no episode in split 'val'") as refused:
        Dataset(folder).split("val")
    assert "carstage split" in refused.value.hint


GOOD: dict[str, Any] = {
    "format_version": 1, "seed": 0, "shares": {"val": 0.5, "test": 0}, "stratify": [],
    "episodes": {"0000000000000000": "train"},
}  # fmt: skip


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "cannot be read"),
        (b"[" * 100_000, "cannot be read"),
        (b"[]", "it needs"),
        (b'{"a": 1, "a": 2}', "twice"),
        ({**GOOD, "format_version": 2}, "format version 2"),
        ({**GOOD, "seed": "0"}, "seed"),
        ({**GOOD, "seed": True}, "seed"),
        ({**GOOD, "shares": {"val": "much", "test": 0}}, "shares"),
        ({**GOOD, "shares": {"val": float("nan"), "test": 0}}, "no share"),
        ({**GOOD, "shares": {"val": 0.9, "test": 0.9}}, "nothing for training"),
        ({**GOOD, "stratify": ["town"]}, "stratify"),
        ({**GOOD, "episodes": []}, "episodes"),
        ({**GOOD, "episodes": {"../../etc": "train"}}, "no id of an episode"),
        ({**GOOD, "episodes": {"a": "validation"}}, "no split"),
        ({**GOOD, "episodes": {"a": ["val"]}}, "no split"),
        (b" " * ((16 << 20) + 1), "fitting size"),
    ],
)
def test_a_strange_file_is_refused_by_name(tmp_path: Path, content: Any, words: str) -> None:
    folder = bare(tmp_path / "data", 1)
    made = content if isinstance(content, bytes) else json.dumps(content).encode()
    (folder / "splits.json").write_bytes(made)
    with pytest.raises(DatasetError, match=words) as refused:
        Dataset(folder).splits()
    assert "splits.json" in refused.value.message
    findings = Findings(None)
    check_splits(Dataset(folder), findings)
    assert [(p.check, p.severity) for p in findings.problems()] == [("splits", "error")]


def test_validation_names_episodes_that_are_gone_and_splits_that_are_empty(tmp_path: Path) -> None:
    folder = bare(tmp_path / "data", 4)
    stored = split_dataset(folder, SplitRule(val=0.25))
    findings = Findings(None)
    check_splits(Dataset(folder), findings)
    assert findings.problems() == []
    (gone,) = [name for name, split in stored.episodes.items() if split == "val"]
    (folder / f"commits/{gone}.json").unlink()
    check_splits(Dataset(folder), findings)
    assert [problem.severity for problem in findings.problems()] == ["warning", "warning"]
    messages = " ".join(problem.message for problem in findings.problems())
    assert gone in messages
    assert "split val" in messages
