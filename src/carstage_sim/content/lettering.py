"""Letters out of small rectangles: number plates, marks of emergency vehicles, bus signs."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache

import numpy as np

from carstage_sim.content.lofting import Array, ShapeBuilder

COLUMNS, ROWS = 5, 7
_PITCH = COLUMNS + 1.2
_GLYPHS: dict[str, str] = {
    "A": ".###.#...##...#######...##...##...#",
    "B": "####.#...##...#####.#...##...#####.",
    "C": ".###.#...##....#....#....#...#.###.",
    "D": "####.#...##...##...##...##...#####.",
    "E": "######....#....####.#....#....#####",
    "F": "######....#....####.#....#....#....",
    "G": ".###.#...##....#.####...##...#.###.",
    "H": "#...##...##...#######...##...##...#",
    "I": "#####..#....#....#....#....#..#####",
    "K": "#...##..#.#.#..##...#.#..#..#.#...#",
    "L": "#....#....#....#....#....#....#####",
    "M": "#...###.###.#.##.#.##...##...##...#",
    "N": "#...###..##.#.##.#.##..###...##...#",
    "O": ".###.#...##...##...##...##...#.###.",
    "P": "####.#...##...#####.#....#....#....",
    "R": "####.#...##...#####.#.#..#..#.#...#",
    "S": ".#####....#.....###.....#....#####.",
    "T": "#####..#....#....#....#....#....#..",
    "U": "#...##...##...##...##...##...#.###.",
    "V": "#...##...##...##...##...#.#.#...#..",
    "X": "#...##...#.#.#...#...#.#.#...##...#",
    "Y": "#...##...#.#.#...#....#....#....#..",
    "Z": "#####....#...#...#...#...#....#####",
    "0": ".###.#...##..###.#.###..##...#.###.",
    "1": "..#...##....#....#....#....#..#####",
    "2": ".###.#...#....#...#...#...#...#####",
    "3": "#####....#...#...##.....##...#.###.",
    "4": "...#...##..#.#.#..#.#####...#....#.",
    "5": "######....####.....#....##...#.###.",
    "6": ".###.#....#....####.#...##...#.###.",
    "7": "#####....#...#...#...#....#....#...",
    "8": ".###.#...##...#.###.#...##...#.###.",
    "9": ".###.#...##...#.####....#....#.###.",
    " ": "." * (COLUMNS * ROWS),
}
_PLATE_LETTERS = "ABCDEFGHKLMNPRSTUVXYZ"


@cache
def _rectangles(letter: str) -> tuple[tuple[int, int, int, int], ...]:
    """Column from and to, row from and to (from the top) of rectangles that cover a glyph."""
    dots = np.array([c == "#" for c in _GLYPHS[letter]]).reshape(ROWS, COLUMNS)
    found = []
    while dots.any():
        row, column = (int(k) for k in np.argwhere(dots)[0])
        right, below = column, row
        while right < COLUMNS and dots[row, right]:
            right += 1
        down = row
        while down < ROWS and dots[down, column]:
            down += 1
        if right - column >= down - row:
            below = row + 1
        else:
            right, below = column + 1, down
        dots[row:below, column:right] = False
        found.append((column, right, row, below))
    return tuple(found)


def text_width(text: str, height: float) -> float:
    """Width of a line of text in metres."""
    return (len(text) * _PITCH - (_PITCH - COLUMNS)) * height / ROWS


def text_rectangles(text: str, height: float) -> list[tuple[float, float, float, float]]:
    """Rectangles that make up a line of text, in metres from its middle.

    Returns:
        Least and largest place along the line, least and largest place upwards of each.
    """
    unit = height / ROWS
    left = -text_width(text, height) / 2
    found = []
    for number, letter in enumerate(text):
        first = left + number * _PITCH * unit
        for c0, c1, r0, r1 in _rectangles(letter):
            low, high = height / 2 - r1 * unit, height / 2 - r0 * unit
            found.append((first + c0 * unit, first + c1 * unit, low, high))
    return found


def add_text(
    builder: ShapeBuilder,
    text: str,
    height: float,
    place: Callable[[Array, Array], Array],
    material: int,
) -> None:
    """Add a line of text.

    Args:
        builder: receives it.
        text: capitals, digits and blanks.
        height: of the letters, metres.
        place: points ``(N, 3)`` of places ``along, up`` (metres) from the middle of the line.
        material: of the letters.
    """
    corners: list[tuple[float, float]] = []
    triangles: list[tuple[int, int, int]] = []
    for a0, a1, b0, b1 in text_rectangles(text, height):
        k = len(corners)
        corners += [(a0, b0), (a1, b0), (a1, b1), (a0, b1)]
        triangles += [(k, k + 1, k + 2), (k, k + 2, k + 3)]
    if corners:
        along, up = np.array(corners).T
        builder.add(place(along, up), triangles, material)


def plate_number(seed: str) -> str:
    """An invented number of a number plate; the same for the same seed."""
    digest = hashlib.sha256(seed.encode()).digest()
    letters = "".join(_PLATE_LETTERS[b % len(_PLATE_LETTERS)] for b in digest[:2])
    return f"{letters} {digest[2] % 10}{digest[3] % 10}{digest[4] % 10}{digest[5] % 10}"
