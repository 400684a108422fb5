"""Kernels of the CPU as WGSL: types, order of assignments, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.kernels import device
from carstage_sim.render.gpu.translate import Translator
from carstage_sim.render.gpu.values import Array, Either, TranslationError, Value

REAL, WHOLE = Value("x", "f32"), Value("i", "i32")


@device
def swapped(a, b):
    a, b = b, a
    return a - b


@device
def mixed(i, x):
    total = 0
    for k in range(i):
        total += k * x
    return total


@device
def switched(on, x):
    if on and x > 0:
        return x
    return np.float32(0)


@device
def first_of(numbers, i):
    return numbers[i]


@device
def listed(x):
    return [x]


def translated(function, *arguments):
    translator = Translator({})
    name, kind = translator.function(function, arguments)
    return translator.source(), name, kind


def test_both_sides_of_a_swap_are_read_before_either_is_written():
    text, *_ = translated(swapped, REAL, REAL)
    lines = [line.strip() for line in text.splitlines()]
    assert lines.index("let held_2 = v_a;") < lines.index("v_a = held_1;")


def test_a_variable_takes_the_widest_type_that_it_ever_has():
    text, _, kind = translated(mixed, WHOLE, REAL)
    assert kind == "f32"
    assert "var v_total: f32;" in text


def test_what_is_known_not_to_be_asked_for_is_left_out():
    off, *_ = translated(switched, Value("false", "bool"), REAL)
    on, *_ = translated(switched, Value("true", "bool"), REAL)
    assert "if" not in off
    assert "if" in on


def test_one_of_two_arrays_is_read_through_its_condition():
    both = Either("c", Array("one", "f32", 1), Array("two", "f32", 1))
    text, *_ = translated(first_of, both, WHOLE)
    assert "fn one_or_two(first: bool, i0: i32) -> f32" in text
    assert "return one_or_two(numbers_first, v_i);" in text


def test_what_is_not_translated_is_named():
    with pytest.raises(TranslationError, match=r"listed: an expression is not translated: \[x\]"):
        translated(listed, REAL)
