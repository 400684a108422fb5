"""Bakes in processes of their own: what comes out, what is refused, what is bounded."""

from __future__ import annotations

import pytest
import small_maps

from carstage_sim.maps import BackgroundBakes, Bake, BakeOptions, MapSamplingError
from carstage_sim.maps.background import MOST_WAITING
from carstage_sim.maps.loading import TownSource, is_baked
from waiting import await_that

BARE = BakeOptions(scenery=False, navigation=False)


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
    bakes.kill()
    await_end(bakes, dying)
    with pytest.raises(MapSamplingError, match=r"Dying: the process .* ended with status -9"):
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
