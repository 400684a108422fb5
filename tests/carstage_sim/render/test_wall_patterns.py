"""Walls of plaster and concrete: rain marks below edges, splashed plinths, boards and repairs."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.buildings import BUILDING_KINDS, building_mesh
from carstage_sim.kernels import kernel
from carstage_sim.mesh import Material
from carstage_sim.render.detail import BRICK, FAR_M, PLASTER, pattern
from carstage_sim.render.panes import wall_edges
from carstage_sim.render.scene import _panes

pytestmark = pytest.mark.xdist_group("kernels")

WIDE_M, HIGH_M, STEP_M = 16.0, 3.0, 0.02


@kernel
def _look(kind, step, hang_from, foot_from, owner, pixel, out):
    for i in range(out.shape[0]):
        up = np.float32(i) * step
        for j in range(out.shape[1]):
            hang = np.float32(HIGH_M) - up if hang_from else FAR_M
            foot = up if foot_from else FAR_M
            found = pattern(
                kind, np.float32(j) * step, np.float32(3), up, np.float32(0),
                np.float32(-1), np.float32(0), (hang, foot), owner, 0, pixel,
            )  # fmt: skip
            for k in range(3):
                out[i, j, k] = found[k]


@kernel
def _edges(packed, weights, out):
    for i in range(len(weights)):
        out[i, 0], out[i, 1] = wall_edges(packed, weights[i, 0], weights[i, 1])


def wall(*, owner=7, hang=False, foot=False, pixel=0.01):
    """``(rows from the foot, columns, 3)`` colour factors of a wall."""
    out = np.empty((round(HIGH_M / STEP_M), round(WIDE_M / STEP_M), 3), np.float32)
    _look(PLASTER, np.float32(STEP_M), hang, foot, owner, np.float32(pixel), out)
    return out


def edges(packed, *weights):
    out = np.empty((len(weights), 2), np.float32)
    _edges(packed, np.array(weights, np.float32), out)
    return out.tolist()


def test_rain_leaves_marks_below_an_edge_and_none_far_below():
    plain, marked = wall(), wall(hang=True)
    darker = 1.0 - marked / plain
    below = darker[-60:-5]
    assert below.max() > 0.2
    assert 0.1 < (below[..., 0] > 0.02).mean() < 0.8, "in places, not all along"
    assert darker[:30].max() < 1e-6, "rain marks end 2.2 m below the edge"
    assert (darker[..., 2] >= darker[..., 0] - 1e-6).all(), "dirt is brown"


def test_a_plinth_is_splashed_at_its_foot_only():
    darker = (1.0 - wall(foot=True) / wall()).mean(axis=(1, 2))
    assert darker[0] > 0.4
    assert (np.diff(darker[:30]) <= 1e-6).all()
    assert darker[40:].max() == pytest.approx(0.0, abs=1e-6)


def test_houses_differ_in_boards_and_some_walls_were_repaired():
    brightness = [wall(owner=owner).mean(axis=2) for owner in range(1, 13)]
    seams = [np.median(picture, axis=1).min() / np.median(picture) for picture in brightness]
    assert min(seams) < 0.95, "boards have joints"
    assert max(seams) > 0.95, "other walls have none"


def test_a_wall_seen_from_afar_is_its_mean_and_has_no_grain():
    near, far = wall(pixel=0.004), wall(pixel=0.5)
    assert far.mean() == pytest.approx(near.mean(), rel=0.03)
    assert (
        np.abs(np.diff(far[..., 0], axis=1)).max()
        < 0.2 * np.abs(np.diff(near[..., 0], axis=1)).max()
    )


def test_a_wall_next_to_the_camera_is_never_flat():
    """32 x 32 pixels of a wall two metres away, 1280 pixels wide."""
    out = wall(pixel=0.0031)[..., 1]
    cells = out[:128, :800].reshape(8, 16, 50, 16).std(axis=(1, 3))
    assert cells.min() > 0.01


@pytest.mark.parametrize("kind", [BRICK, PLASTER])
def test_a_wall_across_a_junction_is_not_flat(kind):
    """Patches of 32 x 32 pixels of a wall 30 m away, 1280 pixels wide."""
    out = np.empty((320, 640, 3), np.float32)
    pixel = np.float32(0.047)
    _look(kind, pixel, False, False, 7, pixel, out)
    cells = out[..., 1].reshape(10, 32, 20, 32)
    relative = cells.std(axis=(1, 3)) / cells.mean(axis=(1, 3))
    assert np.median(relative) > 0.03
    assert (relative < 0.02).mean() < 0.05


def test_bricks_that_are_too_small_for_pixels_leave_the_mean_of_their_tones():
    """Tones deviate by 0.22 / sqrt(3), those of two bricks by 0.09; a fifth of a wall is joints."""
    pixel = np.float32(0.08)
    out = np.empty((160, 320, 3), np.float32)
    _look(BRICK, pixel, False, False, 7, pixel, out)
    red = out[..., 0] / out[..., 0].mean()
    # Neighbours 0.24 m apart share no brick; what is slower than that is weather.
    apart = (red[:, 3:] - red[:, :-3]).std() / np.sqrt(2.0)
    assert 0.05 < apart < 0.09


def kept(pixel, brick):
    """Variance that a mean over a pixel keeps of tones by chance, along one side of bricks."""
    if pixel < brick:
        return 1.0 - pixel / brick / 3.0
    return brick / pixel * (1.0 - brick / pixel / 3.0)


@pytest.mark.parametrize("pixel_m", [0.12, 0.16, 0.2, 0.3])
def test_the_mean_of_several_bricks_varies_as_tones_by_chance_do(pixel_m):
    pixel = np.float32(pixel_m)
    out = np.empty((160, 320, 3), np.float32)
    _look(BRICK, pixel, False, False, 7, pixel, out)
    red = out[..., 0] / out[..., 0].mean()
    away = max(3, round(0.5 / pixel_m))
    apart = (red[:, away:] - red[:, :-away]).std() / np.sqrt(2.0)
    wanted = 0.22 / np.sqrt(3.0) * np.sqrt(kept(pixel_m, 0.25) * kept(pixel_m, 0.083))
    assert apart == pytest.approx(wanted, rel=0.15)


def test_edges_of_strips_and_plinths_are_known_from_their_size():
    strip, plinth, pier, sill = (
        4 * wide + 512 * high for wide, high in ((80, 15), (80, 6), (12, 18), (13, 10))
    )
    middle = (0.25, 0.5)  # of the first half: a quarter of its height up
    far = float(FAR_M)
    assert edges(1 + strip, middle)[0] == pytest.approx([1.125, far])
    assert edges(1 + plinth, middle)[0] == pytest.approx([far, 0.15])
    assert edges(1 + pier, middle)[0] == [far, far]
    assert edges(1 + sill, middle)[0] == pytest.approx([0.75, far])
    assert edges(0, middle)[0] == [far, far]
    # Both halves agree along the diagonal, where the third weight or the second is zero.
    assert edges(1 + strip, (0.3, 0.0))[0] == pytest.approx(edges(2 + strip, (0.3, 0.7))[0])


@pytest.mark.parametrize("kind", BUILDING_KINDS, ids=lambda kind: kind.name)
def test_walls_of_buildings_tell_their_size_and_sides_stand_on_plinths(kind):
    mesh = building_mesh(kind, 20.0, 12.0, kind.floors[0], np.random.default_rng(3))
    told = _panes(mesh)
    high = told[(told & 3) > 0] // 512
    walls = np.isin(mesh.material, (Material.PLASTER, Material.CONCRETE)) & ((told & 3) > 0)
    if kind.style.wall == Material.METAL:
        return
    assert walls.any()
    assert (high == 6).sum() >= 6, "three walls at least have a plinth"
    corners = mesh.vertices[mesh.triangles]
    plinths = corners[(told // 512 == 6) & walls]
    assert plinths[..., 2].min() == pytest.approx(0.0, abs=1e-6)
    # Level slabs and roofs are no walls.
    assert (np.ptp(corners[walls][..., 2], axis=1) > 0).all()
