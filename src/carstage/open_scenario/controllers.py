"""Controllers: who drives somebody."""

from __future__ import annotations

from carstage.open_scenario.document import Element

FASTEST_M_S = 150.0
_EXTERNAL = "external_control"
_MODULES = ("npc_vehicle_control", "simple_vehicle_control", "pedestrian_control")
"""Controllers of scenario_runner that do what Car-STAGE does with somebody: follow the lane."""


def check_controller(action: Element, is_ego: bool) -> None:
    """Refuse a ``ControllerAction`` that asks for more than Car-STAGE's ways of driving.

    Args:
        action: the element.
        is_ego: whether it is the ego's; that may be driven from outside, by ``ego.driver``.

    Raises:
        ConfigError: it does.
    """
    action.allow("", "AssignControllerAction OverrideControllerValueAction")
    assigned = action.maybe("AssignControllerAction")
    if assigned is not None:
        controller = assigned.only_child("Controller")
        for each in controller.child("Properties").children():
            each.allow("name value")
            if each.text("name") != "module":
                each.refuse("this property is not known to Car-STAGE")
            known = (*_MODULES, _EXTERNAL) if is_ego else _MODULES
            each.choice("value", known)
    overridden = action.maybe("OverrideControllerValueAction")
    for each in [] if overridden is None else overridden.children():
        if each.flag("active"):
            each.refuse("pedals by the file are not known to Car-STAGE")
