"""The recorder and the replayer."""

from __future__ import annotations

import tempfile
from pathlib import Path

import carla

from client_api.entries import works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect


@works("Client.start_recorder", "Client.stop_recorder", "Client.show_recorder_file_info",
       "Client.show_recorder_collisions", "Client.show_recorder_actors_blocked",
       "Client.replay_file", "Client.stop_replayer", "Client.set_replayer_time_factor",
       "Client.set_replayer_ignore_hero", "Client.set_replayer_ignore_spectator")  # fmt: skip
def _recording(scene: TrialScene) -> None:
    """A drive is recorded, described, and played again where it was driven."""
    client = scene.client
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "drive.log")
        car = scene.car()
        start = car.get_location()
        expect("drive.log" in client.start_recorder(path, True), "start_recorder")
        car.apply_control(carla.VehicleControl(throttle=0.6))
        scene.ticks(40)
        end = car.get_location()
        client.stop_recorder()
        scene.ticks()
        scene.sweep()
        expect("vehicle.tesla.model3" in client.show_recorder_file_info(path, True), "file info")
        client.show_recorder_collisions(path, "v", "v")
        client.show_recorder_actors_blocked(path, 10.0, 1.0)
        client.set_replayer_time_factor(1.0)
        client.set_replayer_ignore_hero(False)
        if has("Client.set_replayer_ignore_spectator"):
            client.set_replayer_ignore_spectator(True)
        client.replay_file(path, 0.0, 0.0, 0, False)
        scene.ticks(20)
        cars = list(scene.world.get_actors().filter("vehicle.tesla.model3"))
        expect(len(cars) == 1, f"{len(cars)} cars are played")
        way, played = end.distance(start), cars[0].get_location()
        expect(played.distance(start) < way + 1.0 and played.distance(end) < way + 1.0, "elsewhere")
        expect(played.distance(start) > 0.05, "it stands still")
        client.stop_replayer(False)
        scene.ticks(2)
        expect(len(scene.world.get_actors().filter("vehicle.tesla.model3")) == 0, "it stays")
