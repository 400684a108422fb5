"""Bakes in processes of their own: what comes out, what is refused, what is bounded."""

from __future__ import annotations

import dataclasses
import errno
import json
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import small_maps
from carstage_sim.maps import (
    BackgroundBakes,
    Bake,
    BakeLimits,
    BakeOptions,
    MapSamplingError,
    background,
    loading,
)
from carstage_sim.maps.background import MOST_WAITING
from carstage_sim.maps.loading import TownSource, is_baked
from waiting import await_that

BARE = BakeOptions(scenery=False, navigation=False)
LONG = small_maps.document(*(small_maps.road(n, 0, 9 * n, 0, 900) for n in range(99)))


def source(name="Road", *, text=None, origin=""):
    return TownSource(name, small_maps.one_road() if text is None else text, BARE, origin)


@pytest.fixture
def bakes(tmp_path):
    with BackgroundBakes(tmp_path) as running:
        yield running


def await_end(bakes: BackgroundBakes, bake: Bake) -> None:
    def ended() -> bool:
        bakes.advance()
        return bake.finished

    await_that(ended, within_s=120.0)


def test_a_bake_leaves_the_town_in_the_cache_while_its_caller_goes_on(bakes, tmp_path):
    bake = bakes.begin(source())
    assert not bake.finished
    assert bakes.begin(source()) is bake
    await_end(bakes, bake)
    bake.result()
    assert is_baked(source(), cache_folder=tmp_path)
    assert bakes.begin(source()).finished


def test_a_text_that_is_no_map_is_refused_before_a_process_starts(bakes):
    with pytest.raises(MapSamplingError, match=r"mine\.xodr: .*no <road>"):
        bakes.begin(source(text="<OpenDRIVE/>", origin="mine.xodr"))


def test_a_map_without_lanes_to_drive_on_is_refused_in_the_bakes_own_words(bakes, tmp_path):
    walk = small_maps.document(small_maps.road(1, 0, 0, 0, 50, lanes=(("sidewalk", 2.0),)))
    bake = bakes.begin(source(text=walk, origin="mine.xodr"))
    await_end(bakes, bake)
    with pytest.raises(MapSamplingError, match=r"mine\.xodr: .*no lane of type driving"):
        bake.result()
    assert not is_baked(source(text=walk), cache_folder=tmp_path)


def test_a_bake_that_dies_is_told_with_its_status_and_the_next_one_runs(bakes):
    dying, next_one = bakes.begin(source("Dying")), bakes.begin(source("Next"))
    assert bakes.process_id is not None
    os.killpg(bakes.process_id, signal.SIGTERM)
    await_end(bakes, dying)
    with pytest.raises(
        MapSamplingError, match=r"Dying: the process .* ended with status (-15|143)"
    ):
        dying.result()
    await_end(bakes, next_one)
    next_one.result()


def test_no_more_bakes_wait_than_are_allowed_and_none_outlives_its_owner(bakes):
    for number in range(MOST_WAITING):
        bakes.begin(source(f"Road{number}"))
    with pytest.raises(MapSamplingError, match=f"{MOST_WAITING} others are being baked"):
        bakes.begin(source("OneMore"))
    bakes.close()
    assert bakes.process_id is None


@pytest.mark.parametrize("answer", ["", '"half a sent'])
def test_an_answer_that_a_full_disk_cut_off_is_a_failed_bake(bakes, tmp_path, monkeypatch, answer):
    process = tmp_path / "process.py"
    process.write_text(f"import sys; open(sys.argv[2], 'w').write({answer!r}); sys.exit(1)")
    monkeypatch.setattr(background, "_COMMAND", (sys.executable, str(process)))
    first, second = bakes.begin(source("Full")), bakes.begin(source("Disk"))
    for bake in (first, second):
        await_end(bakes, bake)
        with pytest.raises(MapSamplingError, match="ended with status 1"):
            bake.result()


def test_a_bake_that_cannot_begin_is_refused_and_the_next_one_tried(bakes, monkeypatch):
    def no_space(*_arguments, **_options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(background.tempfile, "TemporaryDirectory", no_space)
    bake = bakes.begin(source())
    assert bake.finished
    with pytest.raises(MapSamplingError, match=r"Road: its bake could not begin: .*No space"):
        bake.result()
    monkeypatch.undo()
    assert not bakes.begin(source()).finished


def test_a_bake_that_nobody_waits_for_any_more_is_not_begun(bakes):
    under_way, left, shared = (bakes.begin(source(name)) for name in ("One", "Left", "Shared"))
    assert bakes.begin(source("Shared")) is shared
    for bake in (under_way, left, shared):
        bakes.leave(bake)
    again = bakes.begin(source("Left"))
    assert again is not left
    assert bakes.begin(source("Shared")) is shared


def test_a_bake_that_everybody_left_ends_soon_and_the_next_one_runs(bakes, tmp_path):
    left, next_one = bakes.begin(source("Left", text=LONG)), bakes.begin(source("Next"))
    process_id = bakes.process_id
    assert process_id is not None
    began_s = time.monotonic()
    bakes.leave(left)
    assert time.monotonic() - began_s < 1.0, "the world waited for the bake's end"
    again = bakes.begin(source("Left", text=LONG))
    assert again is not left
    bakes.leave(again)
    await_end(bakes, left)
    assert not _lives(process_id)
    with pytest.raises(MapSamplingError, match="nobody waits for it any more"):
        left.result()
    await_end(bakes, next_one)
    next_one.result()
    assert not is_baked(source("Left", text=LONG), cache_folder=tmp_path)


def test_a_bake_that_takes_too_long_is_ended_even_if_it_will_not(tmp_path, monkeypatch):
    process = tmp_path / "process.py"
    process.write_text(
        "import signal, time\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\ntime.sleep(600)"
    )
    monkeypatch.setattr(background, "_COMMAND", (sys.executable, str(process)))
    monkeypatch.setattr(background, "_END_TIMEOUT_S", 0.5)
    with BackgroundBakes(tmp_path, BakeLimits(seconds=0.5)) as bakes:
        bake = bakes.begin(source("Slow"))
        await_end(bakes, bake)
        with pytest.raises(MapSamplingError, match=r"Slow: .*longer than 0\.5 s.*--bake-seconds"):
            bake.result()


@pytest.mark.parametrize("memory_mb", [20, 120])
def test_a_bake_that_needs_too_much_memory_is_refused_with_a_sentence(tmp_path, memory_mb):
    with BackgroundBakes(tmp_path, BakeLimits(memory_mb=memory_mb)) as bakes:
        bake = bakes.begin(source("Big", text=LONG))
        await_end(bakes, bake)
        with pytest.raises(MapSamplingError, match=f"Big: .*{memory_mb} MB.*--bake-memory"):
            bake.result()


def test_a_town_of_too_many_triangles_is_refused_and_not_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(loading, "MOST_TRIANGLES", 5)
    with pytest.raises(MapSamplingError, match=r"Road: \d+ triangles are too many"):
        loading.town_of(source(), cache_folder=tmp_path)
    assert not is_baked(source(), cache_folder=tmp_path)


_OWNER = """
import sys, tempfile
from pathlib import Path
from carstage_sim.maps import BackgroundBakes, BakeOptions
from carstage_sim.maps.loading import TownSource
bakes = BackgroundBakes(Path(sys.argv[1]))
bakes.begin(TownSource("Long", Path(sys.argv[2]).read_text(), BakeOptions()))
print(bakes.process_id, flush=True)
sys.stdin.read()
"""


def test_a_bake_ends_and_clears_its_files_when_its_server_was_killed(tmp_path):
    text = tmp_path / "long.xodr"
    text.write_text(LONG)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    with subprocess.Popen(
        [sys.executable, "-c", _OWNER, str(tmp_path / "towns"), str(text)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(scratch)},
    ) as owner:
        assert owner.stdout is not None
        group = int(owner.stdout.readline())
        owner.send_signal(signal.SIGKILL)
    await_that(lambda: not _lives(group), within_s=60.0)
    await_that(lambda: not list(scratch.iterdir()), within_s=60.0)


def test_a_bake_whose_server_is_gone_before_it_begins_clears_its_files(tmp_path):
    record = {
        "source": dataclasses.asdict(source()),
        "cache_folder": str(tmp_path / "towns"),
        "level": logging.WARNING,
        "most_bytes": 6 * 10**9,
    }
    for attempt in range(2):  # the signal comes at a moment that differs from run to run
        folder = tmp_path / f"bake{attempt}"
        folder.mkdir()
        (folder / "job.json").write_text(json.dumps(record))
        subprocess.run(
            [*background._COMMAND, str(folder / "job.json"), str(folder / "answer.json")],
            stdin=subprocess.DEVNULL,
            start_new_session=True,
            timeout=60,
            check=False,
        )
        assert not folder.exists()


def _lives(process_id: int) -> bool:
    """Whether a process that is no child of ours runs; one that nobody reaps does not."""
    try:
        status = Path(f"/proc/{process_id}/stat").read_text()
    except FileNotFoundError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"
