"""The comparison: who takes turns, what is made of the runs, what is written; on made-up runs."""

from __future__ import annotations

import dataclasses
import html
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from carstage.bench.comparison import EXPERIMENTS, PRESETS, Campaign, judge, plan_trials
from carstage.bench.comparison.campaign import TRIALS_FILE, _warm_up
from carstage.bench.comparison.contents import contents_of
from carstage.bench.comparison.figures import line, of, spread
from carstage.bench.comparison.programs import CARSTAGE, DISCARD, NATIVE, PROGRAMS
from carstage.bench.comparison.report import write_report
from carstage.bench.comparison.running import _spread
from carstage.bench.comparison.trials import Trial, TrialResult, estimate_s
from carstage.config import check_config
from carstage.errors import BadInputError

DOCS = PRESETS["docs"]
MACHINE = {
    "date": "2026-01-01", "cpu": "a CPU", "cores": 2, "slowness": 1.0, "memory_gb": 8.0,
    "gpu": None, "disk": "ext4", "system": "Linux", "python": "3.11", "packages": {},
}  # fmt: skip
START_S = {CARSTAGE: 6.0, DISCARD: 3.0}
CAMERA_S = {CARSTAGE: 0.02, DISCARD: 0.004, NATIVE: 1.6, "native-threads": 0.8, "paper": 0.1}


def result(wall_s: float, **known: Any) -> TrialResult:
    values = {"cpu_s": wall_s, "server_cpu_s": 1.0, "peak_mb": 100.0, "mb": 5.0, **known}
    times = {"wall_s": wall_s, "recorded_s": wall_s}
    return TrialResult(files=3, spawned=20, **times, **values)


def camera_runs() -> list[tuple[Trial, TrialResult]]:
    """Every program takes its share for each camera and frame, and a little by chance."""
    chance = np.random.default_rng(0)
    runs = []
    for trial in plan_trials(DOCS, ["cameras"]):
        per_picture = CAMERA_S.get(trial.program, 0.03)
        wall_s = START_S.get(trial.program, 3.0) + trial.value * trial.frames * per_picture
        runs.append((trial, result(wall_s + chance.uniform(0.0, 0.02))))
    return runs


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_every_scene_of_every_preset_is_a_valid_configuration(preset) -> None:
    for trial in plan_trials(dataclasses.replace(preset, repeats=1), EXPERIMENTS):
        config = check_config(trial.document(preset))
        assert round(config.duration_s * config.fps) == trial.frames


def test_programs_take_turns_and_change_places() -> None:
    trials = plan_trials(DOCS, ["lidars"])
    turns = [t.program for t in trials if (t.value, t.repeat) == (3, 0)]
    assert turns == [DISCARD, "native-ply", CARSTAGE, "native-npy"]
    assert [t.program for t in trials if (t.value, t.repeat) == (3, 1)] == turns[::-1]
    assert len({trial.key for trial in trials}) == len(trials)


def test_slow_programs_record_fewer_frames_and_the_paper_preset_spares_nobody() -> None:
    frames = {t.program: t.frames for t in plan_trials(DOCS, ["cameras"])}
    assert (frames[NATIVE], frames[CARSTAGE]) == (10, 100)
    paper = plan_trials(PRESETS["paper"], EXPERIMENTS)
    assert {t.frames for t in paper if t.experiment == "cameras"} == {2000}
    assert estimate_s(paper, PRESETS["paper"]) > 24 * 3600


def test_added_time_is_per_frame_however_many_frames_a_program_records() -> None:
    runs = camera_runs()
    for name in (NATIVE, CARSTAGE, "native-threads"):
        found = line(of(runs, "cameras", name))
        assert found is not None
        assert found.per_unit_s == pytest.approx(CAMERA_S[name], rel=0.02)
        assert found.begin_s == pytest.approx(START_S.get(name, 3.0), abs=0.1)
        assert found.r2 > 0.999


def test_one_run_that_the_disk_held_up_does_not_turn_the_line() -> None:
    runs = of(camera_runs(), "cameras", CARSTAGE)
    held_up = [(runs[0][0], result(runs[0][1].recorded_s + 5.0)), *runs[1:]]
    found = line(held_up)
    assert found is not None
    assert found.per_unit_s == pytest.approx(CAMERA_S[CARSTAGE], rel=0.02)


@pytest.mark.parametrize(("values", "repeats"), [((1, 5), 2), ((1, 2, 3), 1), ((1, 3, 5), 5)])
def test_a_line_tells_how_far_its_slope_may_be_off(values: tuple[int, ...], repeats: int) -> None:
    chance = np.random.default_rng(0)
    too_low = 0
    for _ in range(1000):
        runs = [
            (Trial("cameras", CARSTAGE, value, repeat, 1), result(9.0 + chance.normal(value, 0.5)))
            for value in values
            for repeat in range(repeats)
        ]
        found = line(runs)
        assert found is not None
        too_low += found.per_unit_s + found.error_s < 1.0
    assert 20 < too_low < 80  # it is said with 95 % confidence


def lidar_runs(own_s: float, chance_s: float) -> list[tuple[Trial, TrialResult]]:
    """Runs of which Car-STAGE's take ``own_s`` for each LiDAR, and others 1 s."""
    chance = np.random.default_rng(1)
    return [
        (trial, result(5.0 + each_s * trial.value + chance.normal(0.0, chance_s)))
        for trial in plan_trials(DOCS, ["lidars"])
        for each_s in [own_s if trial.program == CARSTAGE else 1.0]
    ]


def test_a_sensor_that_costs_less_than_the_noise_has_a_bound() -> None:
    verdict = judge(DOCS, lidar_runs(-0.01, 0.05), "", MACHINE)
    figures = {figure.name: figure for figure in verdict.figures}
    added = figures["lidars: carstage, ms per added LiDAR and frame"]
    assert added.bound == "<="
    assert 0.05 < float(added.value) < 1.0  # the slope is known to some hundredths of a second
    ratio = figures["lidars: native-npy / carstage"]
    per_ms = figures["lidars: native-npy, ms per added LiDAR and frame"]
    assert ratio.bound == ">="
    assert 10.0 < float(ratio.value) < float(per_ms.value) / float(added.value)
    assert ratio.ok  # 1.2 is proved
    noisy = judge(DOCS, lidar_runs(-0.01, 2.0), "", MACHINE)
    (unproved,) = (one for one in noisy.figures if one.name == ratio.name)
    assert (unproved.bound, unproved.ok, noisy.ok) == (">=", False, False)
    assert float(unproved.value) < 1.2
    assert "less than can be measured: < " in verdict.text()
    assert any("--repeat" in note for note in verdict.notes)


def test_what_is_measured_has_no_bound() -> None:
    verdict = judge(DOCS, lidar_runs(0.1, 0.02), "", MACHINE)
    assert all(figure.bound is None for figure in verdict.figures)
    assert not any("--repeat" in note for note in verdict.notes)


def test_one_run_of_each_of_two_values_gives_no_bound_and_proves_nothing(tmp_path: Path) -> None:
    preset = dataclasses.replace(DOCS, lidars=(1, 5), repeats=1)
    runs = [
        (trial, result(5.0 + (-0.1 if trial.program == CARSTAGE else 1.0) * trial.value))
        for trial in plan_trials(preset, ["lidars"])
    ]
    verdict = judge(preset, runs, "", MACHINE)
    figures = {figure.name: figure for figure in verdict.figures}
    own = figures["lidars: carstage, ms per added LiDAR and frame"]
    assert own.value == "less than one run of each can show"
    ratio = figures["lidars: native-npy / carstage"]
    assert (ratio.value, ratio.bound, ratio.ok) == (0.0, ">=", False)
    write_report(tmp_path, preset, MACHINE, runs, verdict)
    assert "| carstage | ? |" in (tmp_path / "comparison.md").read_text()


def test_spread_is_median_and_middle_half() -> None:
    trials = [Trial("cameras", CARSTAGE, 1, repeat, 10) for repeat in range(5)]
    found = spread([(t, result(s)) for t, s in zip(trials, (1, 2, 3, 4, 90), strict=True)], 1)
    assert (found.median_s, found.iqr_s, found.mean_s) == (3.0, 2.0, 20.0)


def test_ratios_stand_beside_their_targets() -> None:
    verdict = judge(DOCS, camera_runs(), "carstage bench cameras", MACHINE)
    figures = {figure.name: figure for figure in verdict.figures}
    native = figures["cameras: native-png / carstage"]
    assert (float(native.value), native.ok) == (pytest.approx(80.0, rel=0.03), True)
    assert figures["cameras: paper / carstage"].ok
    slow = [
        (trial, dataclasses.replace(one, recorded_s=3.0 * one.recorded_s))
        if trial.program == CARSTAGE
        else (trial, one)
        for trial, one in camera_runs()
    ]
    assert not judge(DOCS, slow, "carstage bench cameras", MACHINE).ok


def test_with_16_cores_targets_are_higher_and_whole_runs_have_one() -> None:
    few, many = (
        {one.name: one for one in judge(DOCS, camera_runs(), "", {**MACHINE, "cores": n}).figures}
        for n in (2, 16)
    )
    assert (few["cameras: native-png / carstage"].target, few["cameras: paper / carstage"].ok) == (
        60.0,
        True,
    )
    assert not many["cameras: native-png / carstage"].ok
    whole = "cameras: whole time with 5, carstage / discard"
    assert float(many[whole].value) == pytest.approx(16.0 / 5.0, rel=0.03)
    assert (few[whole].target, many[whole].target) == (None, 1.25)


def test_one_lidar_is_judged_by_the_cpu_time_of_its_run() -> None:
    runs = [
        (t, result(3.0, cpu_s=6.0 if t.program == CARSTAGE else 2.0))
        for t in plan_trials(DOCS, ["lidars"])
    ]
    figures = {one.name: one for one in judge(DOCS, runs, "", {**MACHINE, "cores": 16}).figures}
    figure = figures["lidars: CPU time of a run with 1, carstage / native-npy"]
    assert (figure.value, figure.target, figure.ok) == (3.0, 2.0, False)


def test_the_quick_preset_judges_nothing() -> None:
    quick = PRESETS["quick"]
    runs = [(t, result(1.0 + t.repeat)) for t in plan_trials(quick, ["cameras"])]
    assert judge(quick, runs, "", MACHINE).ok
    assert all(figure.target is None for figure in judge(quick, runs, "", MACHINE).figures)


def test_other_pictures_and_boxes_are_seen() -> None:
    def run(program: str, contents: dict[str, object]) -> tuple[Trial, TrialResult]:
        one = dataclasses.replace(result(1.0), contents=contents)
        return Trial("frames", program, 20, 0, 20), one

    box = [0, 7, 1.0, 2.0, 3.0, 4.0, 6, 0]
    native = run(NATIVE, {"CAM_1/0": "aa", "CAM_1/1": "bb", "boxes": [box]})

    def differing(contents: dict[str, object]) -> tuple[float, float]:
        verdict = judge(DOCS, [native, run(CARSTAGE, contents)], "", MACHINE)
        found = {figure.name: float(figure.value) for figure in verdict.figures}
        return found["pictures and clouds that differ"], found["boxes that differ"]

    near = [0, 7, 1.01, 2.0, 3.0, 4.0, 6, 0]
    far = [0, 7, 1.5, 2.0, 3.0, 4.0, 6, 0]
    level = [0, 7, 1.0, 2.0, 3.0, 4.0, 5, 1]
    other = [0, 8, 1.0, 2.0, 3.0, 4.0, 6, 0]
    assert differing({"CAM_1/0": "aa", "boxes": [near]}) == (0, 0)
    assert differing({"CAM_1/0": "ab", "boxes": [far]}) == (1, 1)
    assert differing({"CAM_1/1": "bb", "boxes": [level]}) == (0, 1)
    assert differing({"CAM_1/1": "bb", "boxes": [other]}) == (0, 2)


def test_files_of_both_layouts_have_the_same_contents(tmp_path: Path) -> None:
    bgra = np.random.default_rng(0).integers(0, 256, (4, 6, 4), np.uint8)
    rgba = np.ascontiguousarray(bgra[..., [2, 1, 0, 3]])
    rig = [{"id": "CAM", "kind": "rgb"}, {"id": "INST", "kind": "instance"}]
    native, own = tmp_path / "native", tmp_path / "own"
    attempt = own / "dataset/episodes/e/a1/sensors"
    for folder in (native / "files", attempt):
        for sensor in rig:
            (folder / sensor["id"]).mkdir(parents=True)
    Image.fromarray(rgba).save(native / "files/CAM/000000.tiff")
    Image.fromarray(rgba).save(native / "files/INST/000000.png")
    Image.fromarray(rgba[..., :3]).save(attempt / "CAM/000000.png")
    ids = bgra[..., 1].astype(np.uint16) + 256 * bgra[..., 0].astype(np.uint16)
    Image.fromarray(ids).save(attempt / "INST/000000.png")
    Image.fromarray(bgra[..., 2]).save(attempt / "INST/000000.tag.png")
    document = {"rig": {"sensors": rig}}
    assert contents_of(native, document) == contents_of(own, document)
    assert sorted(contents_of(own, document)) == ["CAM/0", "INST/0"]


def test_results_are_kept_at_once_and_gone_on_with(tmp_path: Path) -> None:
    first = Campaign(DOCS, ["lidars"], tmp_path)
    trial = first.left[0]
    row = {**dataclasses.asdict(trial), "result": dataclasses.asdict(result(2.0))}
    path = tmp_path / TRIALS_FILE
    with path.open("a") as file:
        file.write(json.dumps(row) + "\n" + json.dumps(row)[:40])  # the last one is torn
    again = Campaign(DOCS, ["lidars"], tmp_path)
    assert len(again.left) == len(first.left) - 1
    assert again.results[trial.key][1].wall_s == 2.0
    assert path.read_bytes().endswith(b"\n")
    more = Campaign(dataclasses.replace(DOCS, repeats=5), ["lidars"], tmp_path)
    assert trial.key in more.results
    with pytest.raises(BadInputError, match="another comparison"):
        Campaign(PRESETS["quick"], ["lidars"], tmp_path)


def test_what_compiles_is_warmed_up_before_anything_counts() -> None:
    todo = plan_trials(DOCS, ["frames", "cameras"])
    warm = _warm_up(todo)
    assert warm[0] == todo[0]
    assert CARSTAGE in {trial.program for trial in warm}
    assert len(warm) <= 2
    others = [trial for trial in todo if trial.program == NATIVE]
    assert _warm_up(others) == others[:1]
    assert _warm_up([]) == []


def test_only_the_programs_that_are_asked_for_run(tmp_path: Path) -> None:
    campaign = Campaign(DOCS, ["cameras"], tmp_path, programs=[CARSTAGE, NATIVE])
    assert {trial.program for trial in campaign.left} == {CARSTAGE, NATIVE}
    with pytest.raises(BadInputError, match="no program 'carstge'"):
        Campaign(DOCS, ["cameras"], tmp_path, programs=["carstge"])


def test_a_program_whose_packages_the_client_lacks_is_named() -> None:
    unknown = dataclasses.replace(PROGRAMS["paper"], needs=("numpy", "no_such_package"))
    assert unknown.lacks(sys.executable, labels=False) == ["no_such_package"]
    assert PROGRAMS[NATIVE].lacks(sys.executable, labels=True) == []


def test_the_report_is_written_in_every_form(tmp_path: Path) -> None:
    runs = camera_runs()
    verdict = judge(DOCS, runs, "carstage bench cameras --preset docs", MACHINE)
    paths = write_report(tmp_path, DOCS, MACHINE, runs, verdict)
    assert {path.name for path in paths} == {
        "comparison.json", "comparison.md", "comparison.html", "cameras.svg",
    }  # fmt: skip
    assert (tmp_path / "cameras.png").read_bytes().startswith(b"\x89PNG")
    record = json.loads((tmp_path / "comparison.json").read_text())
    assert len(record["trials"]) == len(runs)
    assert record["machine"]["cpu"] == "a CPU"
    page = (tmp_path / "comparison.html").read_text()
    assert "http" not in page.replace("http-equiv", "").split("<img")[0]
    assert html.escape(PROGRAMS["paper"].what) in page
    assert "| paper |" in (tmp_path / "comparison.md").read_text()


@pytest.mark.parametrize(
    ("beside_mb", "growth", "holds"),
    [
        ({160: (300.0, 300.0, 300.0)}, 1.0, True),
        ({160: (300.0, 900.0, 300.0)}, 1.0, True),  # one run that stands out
        ({160: (340.0, 300.0, 340.0)}, 340 / 300, False),
    ],
)
def test_memory_is_judged_without_the_data_that_waited(
    beside_mb: dict[int, tuple[float, ...]], growth: float, holds: bool
) -> None:
    queues_mb = {20: 20.0, 40: 40.0, 80: 60.0, 160: 200.0}
    runs = []
    for trial in plan_trials(DOCS, ["frames"]):
        if trial.program == CARSTAGE:
            queue_mb = queues_mb[trial.value]
            peak_mb = beside_mb.get(trial.value, (300.0,) * 3)[trial.repeat] + queue_mb
            runs.append((trial, result(4.0, peak_mb=peak_mb, found={"queue_mb": queue_mb})))
    figures = {one.name: one for one in judge(DOCS, runs, "", MACHINE).figures}
    found = figures["frames: memory without what waited, 160 frames / 80"]
    assert (found.value, found.ok) == (pytest.approx(growth), holds)
    assert figures["frames: most data that waited, MB"].value == 200.0


def test_folders_of_runs_are_spread_over_an_ext4_disk(tmp_path: Path) -> None:
    _spread(tmp_path)  # on every other one it does nothing, and says nothing
    kind = subprocess.check_output(["stat", "-f", "-c", "%T", tmp_path], text=True).strip()
    if kind != "ext2/ext3" or not shutil.which("lsattr"):
        pytest.skip(f"only ext4 has the flag, and only lsattr shows it; this is {kind}")
    assert "T" in subprocess.check_output(["lsattr", "-d", tmp_path], text=True).split()[0]
