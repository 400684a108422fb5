"""What a run shows: few lines in a log, bars with counts on a terminal."""

from __future__ import annotations

import io
from dataclasses import replace

from rich.console import Console

from carstage.cli.bars import BarProgress
from carstage.cli.progress import LineProgress, StepLines
from carstage.plan import RunEstimate
from carstage.runs import CurrentEpisode, EpisodeCounts, events
from carstage.runs.folder import WorkerStatus


def progress_of(ticks: int, frames: int) -> events.Progress:
    return events.Progress(
        "recording",
        EpisodeCounts(total=3, committed=1),
        CurrentEpisode("e", 1, "a1", ticks, 50, frames, 50),
    )


def test_log_gets_a_line_every_five_seconds() -> None:
    lines: list[str] = []
    clock_s = iter([0.0, 1.0, 4.9, 5.1, 6.0])
    progress = LineProgress(lines.append, lambda: next(clock_s))
    for ticks in range(5):
        progress(progress_of(ticks * 10, ticks * 5))
    assert lines == [
        "Episode 2 of 3: recorded 0/50 steps, converted 0/50 frames.",
        "Episode 2 of 3: recorded 30/50 steps, converted 15/50 frames; about 0:00:12 left.",
    ]


def test_an_episode_that_is_in_the_dataset_is_not_told_of_as_the_next() -> None:
    lines: list[str] = []
    clock_s = iter([0.0, 10.0, 20.0])
    progress = LineProgress(lines.append, lambda: next(clock_s))
    first = CurrentEpisode("e", 0, "a1", 40, 50, 30, 50)
    progress(events.Progress("recording", EpisodeCounts(total=1), first))
    progress(events.EpisodeCommitted("e", "a1"))
    last = replace(first, ticks_done=50, frames_converted=50)
    progress(events.Progress("recording", EpisodeCounts(total=1, committed=1), last))
    assert lines == [
        "Episode 1 of 1: recorded 40/50 steps, converted 30/50 frames.",
        "Episode e is in the dataset.",
    ]


def test_an_episode_that_failed_is_counted_once() -> None:
    lines: list[str] = []
    clock_s = iter([0.0, 10.0, 20.0, 30.0])
    progress = LineProgress(lines.append, lambda: next(clock_s))
    first = CurrentEpisode("e", 0, "a1", 40, 50, 30, 50)
    progress(events.Progress("recording", EpisodeCounts(total=2), first))
    progress(events.EpisodeFailed("e", "a1", "lost"))
    progress(events.Progress("recording", EpisodeCounts(total=2, failed=1), first))
    second = CurrentEpisode("f", 1, "a1", 50, 50, 50, 50)
    progress(events.Progress("recording", EpisodeCounts(total=2, failed=1), second))
    assert lines[1:] == [
        "Episode e failed.",
        "Episode 2 of 2: recorded 50/50 steps, converted 50/50 frames; about 0:00:00 left.",
    ]


def test_episodes_of_a_part_are_counted_from_its_first() -> None:
    lines: list[str] = []
    part = events.Progress("recording", EpisodeCounts(total=2), CurrentEpisode("e", 5, "a1"))
    LineProgress(lines.append)(part)
    assert lines == ["Episode 1 of 2: recorded 0 steps, converted 0 frames."]


def test_estimate_is_shown_before_the_run() -> None:
    lines: list[str] = []
    estimate = RunEstimate(106_000_000, 375_000_000, 482_000_000, 25.0)
    LineProgress(lines.append)(events.RunPlanned(estimate, todo=1, skipped=2))
    assert lines[0] == "2 of 3 episodes are in the dataset already."
    assert lines[1].startswith("1 episode to record: about 106 MB (482 MB at most on the way)")


def test_shortfall_of_actors_is_shown() -> None:
    lines: list[str] = []
    LineProgress(lines.append)(events.ActorsSpawned("e", {"vehicles": 9}, {"vehicles": 7}))
    assert "9" in lines[0]
    assert "7" in lines[0]


def test_terminal_shows_episodes_steps_and_frames() -> None:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=100, color_system=None)
    with BarProgress(console) as progress:
        progress(progress_of(20, 10))
        progress(events.Notice("Something [with] brackets."))
    text = screen.getvalue()
    for part in ("Episodes", "1/3", "Recording", "20/50", "Conversion", "10/50", "[with]"):
        assert part in text


def progress_of_workers() -> events.Progress:
    one = CurrentEpisode("e", 1, "a1", 20, 50, 10, 50)
    workers = (
        WorkerStatus(1, "recording", {}, one),
        WorkerStatus(2, "starting", {}),
        WorkerStatus(4, "recording", {}, replace(one, index=4, ticks_done=5)),
    )
    counts = EpisodeCounts(total=60, committed=3, skipped=1, failed=1)
    return events.Progress("recording", counts, one, workers, 83.4)


def test_a_line_of_several_workers_says_what_each_does_and_the_time_left() -> None:
    lines: list[str] = []
    LineProgress(lines.append)(progress_of_workers())
    assert lines == [
        "5 of 60 episodes; worker 1: episode 2, 20/50 steps; worker 2: starting; "
        "worker 4: episode 5, 5/50 steps; about 0:01:23 left."
    ]


def test_bars_show_what_several_workers_do_in_sum() -> None:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=100, color_system=None)
    with BarProgress(console) as progress:
        progress(progress_of_workers())
    for part in ("5/60", "25/100", "20/100"):
        assert part in screen.getvalue()


def test_a_measurement_says_now_and_then_how_long_the_rest_will_take() -> None:
    lines: list[str] = []
    clock_s = iter([0.0, 5.0, 20.0, 25.0])
    progress = StepLines("Ticks", lines.append, lambda: next(clock_s))
    for done in (1, 2, 11, 21):
        progress(done, 21)
    assert lines == ["Ticks: 1 of 21.", "Ticks: 11 of 21, 0:00:20 left.", "Ticks: 21 of 21."]


def test_verdict_of_the_self_test_is_counted() -> None:
    lines: list[str] = []
    checks = [{"name": "frames", "ok": True}, {"name": "LiDAR axes", "ok": False}]
    LineProgress(lines.append)(events.ServerTested(False, "0.9.15", "0.9.15", "Town01", checks))
    assert lines == ["Self-test of the server: 1 of 2 checks hold."]
