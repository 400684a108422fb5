"""Events of the unmodified carla wheel: collisions from the server, crossed markings by itself."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Any

import pytest

from benchmarks.simulator.client_process import run_trial

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

pytestmark = pytest.mark.end_to_end

KEPT: list[Any] = []
"""Of the client process: the wheel may abort when its last object goes while a stream closes."""


def connect(port: int) -> Any:
    """The world of a new episode in synchronous mode."""
    import carla

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(20.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.05
    world.apply_settings(settings)
    KEPT.append(client.reload_world(False))
    return KEPT[-1]


def listening(world: Any, type_id: str, parent: Any, **attributes: str) -> queue.Queue[Any]:
    import carla

    blueprint = world.get_blueprint_library().find(type_id)
    for name, value in attributes.items():
        blueprint.set_attribute(name, value)
    sensor = world.spawn_actor(blueprint, carla.Transform(), attach_to=parent)
    events: queue.Queue[Any] = queue.Queue()
    sensor.listen(events.put)
    events.sensor = sensor  # type: ignore[attr-defined]
    return events


def trial_of_a_collision(port: int) -> dict[str, Any]:
    import carla

    world = connect(port)
    library = world.get_blueprint_library()
    place = world.get_map().get_spawn_points()[0]
    forward = place.get_forward_vector()

    def ahead(type_id: str, distance_m: float) -> Any:
        location = place.location + forward * distance_m + carla.Location(z=0.5)
        return world.spawn_actor(library.find(type_id), carla.Transform(location, place.rotation))

    car = world.spawn_actor(library.find("vehicle.tesla.model3"), place)
    walker = ahead("walker.pedestrian.0001", 5.0)
    other = ahead("vehicle.audi.tt", 12.0)
    own, others = (listening(world, "sensor.other.collision", actor) for actor in (car, other))
    frames = []
    for _ in range(60):
        car.set_target_velocity(forward * 8.0)
        frames.append(world.tick())
    met = {}
    while not own.empty():
        event = own.get()
        impulse = event.normal_impulse
        along = impulse.x * forward.x + impulse.y * forward.y
        entry = (event.frame, event.actor.id == car.id, event.other_actor.type_id, along)
        met.setdefault(event.other_actor.id, entry)
    struck = others.get(timeout=20.0)
    while struck.other_actor.id != car.id:  # the walker, pushed ahead by the car
        struck = others.get(timeout=20.0)
    for events in (own, others):
        events.sensor.stop()  # type: ignore[attr-defined]
    return {
        "frames": (frames[0], frames[-1]),
        "walker": met[walker.id],
        "car": met[other.id],
        "struck": (struck.frame, struck.actor.id == other.id, struck.other_actor.id == car.id),
    }


def test_collisions_reach_both_cars_with_the_frame_and_the_other(
    simulator: RunningSimulator,
) -> None:
    found = run_trial(trial_of_a_collision, simulator.port, timeout_s=90)
    first, last = found["frames"]
    walker_frame, own, walker_type, walker_impulse = found["walker"]
    car_frame, own_too, car_type, car_impulse = found["car"]
    assert first < walker_frame < car_frame < last
    assert own
    assert own_too
    assert (walker_type, car_type) == ("walker.pedestrian.0001", "vehicle.audi.tt")
    assert car_impulse < walker_impulse < 0.0  # both hold the car back, the car more
    assert found["struck"] == (car_frame, True, True)


def trial_of_lane_invasion(port: int) -> tuple[list[tuple[int, list[str]]], int]:
    import carla

    world = connect(port)
    place = world.get_map().get_spawn_points()[0]
    car = world.spawn_actor(world.get_blueprint_library().find("vehicle.tesla.model3"), place)
    car.set_simulate_physics(False)
    events = listening(world, "sensor.other.lane_invasion", car)
    right = place.get_right_vector()
    world.tick()
    for step in range(20):
        location = place.location + right * (-0.3 * step)
        car.set_transform(carla.Transform(location, place.rotation))
        last = world.tick()
    found = []
    while not events.empty():
        # The wheel's own event.actor raises: a client-side event knows no episode.
        event = events.get()
        found.append((event.frame, [str(line.type) for line in event.crossed_lane_markings]))
    events.sensor.stop()  # type: ignore[attr-defined]
    return found, last


def test_the_client_tells_of_a_crossed_marking(simulator: RunningSimulator) -> None:
    events, last = run_trial(trial_of_lane_invasion, simulator.port, timeout_s=90)
    assert events
    assert all(last - 20 < frame <= last for frame, _ in events)
    assert {"Broken", "Solid", "SolidSolid"} & {kind for _, kinds in events for kind in kinds}, (
        events
    )
