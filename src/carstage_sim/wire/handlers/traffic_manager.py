"""The registry of Traffic Managers, which run in clients."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire.handlers.registry import Call, handles, handles_void


@handles("is_traffic_manager_running")
def _is_traffic_manager_running(call: Call, port: int) -> bool:
    return call.session.traffic_managers.running(port)


@handles("get_traffic_manager_running")
def _get_traffic_manager_running(call: Call, port: int) -> list[Any]:
    return list(call.session.traffic_managers.where(port))


@handles("add_traffic_manager_running")
def _add_traffic_manager_running(call: Call, address: list[Any]) -> bool:
    host, port = address
    return call.session.traffic_managers.add(host, port, call.connection)


@handles_void("destroy_traffic_manager")
def _destroy_traffic_manager(call: Call, port: int) -> None:
    call.session.traffic_managers.remove(port)
