"""Classes of the specification are values, with methods that are made once for all of them."""

from __future__ import annotations

import importlib
import pickle
import pkgutil
from dataclasses import FrozenInstanceError, dataclass, is_dataclass, make_dataclass, replace

import pytest

from carstage import spec
from carstage.spec import GroupSpec, Place, RouteSpec, Stand
from carstage.spec.values import Value


def classes() -> list[type]:
    modules = [importlib.import_module(f"carstage.spec.{m.name}") for m in iter_modules()]
    return [
        each
        for module in modules
        for each in vars(module).values()
        if isinstance(each, type) and each.__module__ == module.__name__ and is_dataclass(each)
    ]


def iter_modules() -> list[pkgutil.ModuleInfo]:
    return list(pkgutil.iter_modules(spec.__path__))


def test_no_class_of_the_specification_has_methods_of_its_own_for_that() -> None:
    found = classes()
    assert len(found) > 50
    for each in found:
        for name in ("__eq__", "__hash__", "__repr__"):
            assert getattr(each, name) is getattr(Value, name), each


def test_they_are_what_a_dataclass_makes() -> None:
    ours, other = Place(1.0, 2.0), Place(1.0, 2.5)
    made = make_dataclass("Place", ["x_m", "y_m"], frozen=True)
    assert ours == Place(1.0, 2.0)
    assert ours != other
    assert ours != made(1.0, 2.0)
    assert ours != Stand(1.0, 2.0, 0.0, 0.0)
    assert hash(ours) == hash(made(1.0, 2.0)) == hash(replace(other, y_m=2.0))
    assert repr(ours) == repr(made(1.0, 2.0)) == "Place(x_m=1.0, y_m=2.0)"
    assert repr(RouteSpec((3, ours))).startswith("RouteSpec(through=(3, Place(x_m=1.0, y_m=2.0))")
    assert pickle.loads(pickle.dumps(ours)) == ours
    with pytest.raises(FrozenInstanceError):
        ours.x_m = 3.0  # type: ignore[misc]


def test_a_class_derived_elsewhere_may_have_its_own() -> None:
    @dataclass(frozen=True)
    class Ours(GroupSpec):
        more: int = 0

    assert Ours(1, "vehicle.*") == Ours(1, "vehicle.*")
    assert Ours(1, "vehicle.*", more=1) != Ours(1, "vehicle.*")
    assert Ours(1, "vehicle.*") != GroupSpec(1, "vehicle.*")
