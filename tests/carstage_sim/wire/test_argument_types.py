"""Handlers get what their annotations say, or nothing."""

from __future__ import annotations

from typing import Any

import pytest

from carstage_sim.wire.argument_types import argument_check
from carstage_sim.wire.errors import CallError

NOWHERE: list[float] = []


def handler(
    _call: object, actor_id: int, seconds: float, name: str, on: bool, place: list[float] = NOWHERE
) -> None:
    """Takes one of each."""


FITTING: list[Any] = [7, 1.5, "here", True, [0.0, 0.0, 0.0]]


@pytest.mark.parametrize("count", [4, 5])
def test_arguments_of_the_declared_types_pass(count: int) -> None:
    argument_check(handler)("call", FITTING[:count])


def test_whole_number_passes_for_a_float() -> None:
    argument_check(handler)("call", [7, 2, "here", True])


@pytest.mark.parametrize("count", [0, 3, 6])
def test_wrong_number_of_arguments_is_refused(count: int) -> None:
    with pytest.raises(CallError, match=f"call takes 4 arguments, got {count}"):
        argument_check(handler)("call", [*FITTING, 0][:count])


@pytest.mark.parametrize(
    ("position", "value"),
    [
        *((0, value) for value in (7.0, True, "7", None)),
        *((1, value) for value in (float("nan"), float("inf"), 1e300, "1", False)),
        *((2, value) for value in (b"here", 3, None)),
        *((3, value) for value in (1, "true", None)),
        *((4, value) for value in ({}, "abc", None)),
    ],
)
def test_value_of_another_type_is_refused_by_its_position(position: int, value: Any) -> None:
    arguments = [*FITTING[:position], value, *FITTING[position + 1 :]]
    with pytest.raises(CallError, match=f"argument {position + 1} of call must be"):
        argument_check(handler)("call", arguments)


@pytest.mark.parametrize("element", [1.0, True, None, "7", [], {}])
def test_list_with_an_element_of_another_type_is_refused(element: Any) -> None:
    def listed(_call: object, ids: list[int]) -> None:
        """Takes whole numbers."""

    argument_check(listed)("call", [[1, 2]])
    with pytest.raises(CallError, match="argument 1 of call must be a list of int"):
        argument_check(listed)("call", [[1, element]])
