"""Record what your own CARLA script ticks: `python record_own_client.py OUT`.

The server is the embedded one; with the address of a CARLA server it works the same.
"""

import sys

import carla
from drive_simulator import embedded_server

import carstage

RIG = {
    "image_size": [160, 90],
    "rig": {
        "sensors": [
            {"id": "CAM_FRONT", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "IMU", "kind": "imu", "pose": {"z": 0.5}},
        ]
    },
}


def main() -> None:
    """Run the example."""
    with embedded_server() as (host, port):
        client = carla.Client(host, port)
        client.set_timeout(120.0)  # the first start on a machine compiles
        world = client.get_world()
        settings = world.get_settings()
        settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.1
        world.apply_settings(settings)
        car = world.spawn_actor(
            world.get_blueprint_library().find("vehicle.tesla.model3"),
            world.get_map().get_spawn_points()[0],
        )
        world.tick()
        server = f"{host}:{port}"
        with carstage.recording(world, car, RIG, sys.argv[1], server=server) as recorded:
            car.apply_control(carla.VehicleControl(throttle=0.6))
            for _ in range(20):
                world.tick()
        assert recorded.result is not None
        print(f"{recorded.result.frames} frames in {recorded.result.dataset}")


if __name__ == "__main__":
    main()
