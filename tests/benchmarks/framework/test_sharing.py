"""One process and many find and write the same."""

from __future__ import annotations

from pathlib import Path

from analytic_dataset import make_dataset
from benchmarks.framework.sharing import measure_sharing


def test_validation_and_exports_are_measured_in_one_process_and_in_many(tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "out", tmp_path / "work", steps=12)
    rounds: list[tuple[int, int]] = []

    verdict = measure_sharing(dataset, rounds=1, progress=lambda *done: rounds.append(done))

    figures = {figure.name: figure for figure in verdict.figures}
    assert rounds == [(1, 1)]
    assert figures["valid"].ok
    assert figures["verdicts_that_differ"].value == figures["exports_that_differ"].value == 0
    assert figures["validate_cpu_s_with_0"].value > 0.0
    assert figures["export_cpu_ratio"].value > 0.0
