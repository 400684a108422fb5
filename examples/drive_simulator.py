"""A CARLA script of your own on the embedded simulator: `python drive_simulator.py OUT.png`.

Nothing here is special to it: give the address of a CARLA server instead, and it works the same.
"""

import queue
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import carla

STEP_S = 0.05


@contextmanager
def embedded_server() -> Iterator[tuple[str, int]]:
    """Start the simulator on a free port; it ends with the block."""
    command = [sys.executable, "-m", "carstage_sim", "--port", "0", "--exit-with-parent"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            ready = re.search(r"rpc=([\d.]+):(\d+)", process.stdout.readline())
            if ready is None:
                sys.exit("The simulator did not start.")
            yield ready[1], int(ready[2])
        finally:
            process.terminate()


def drive(client: carla.Client, target: str) -> None:
    """Drive for two seconds and save what the camera on the roof saw last."""
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, STEP_S
    world.apply_settings(settings)
    library = world.get_blueprint_library()
    car = world.spawn_actor(
        library.find("vehicle.tesla.model3"), world.get_map().get_spawn_points()[0]
    )
    blueprint = library.find("sensor.camera.rgb")
    blueprint.set_attribute("image_size_x", "320")
    blueprint.set_attribute("image_size_y", "180")
    roof = carla.Transform(carla.Location(x=0.5, z=1.8))
    camera = world.spawn_actor(blueprint, roof, attach_to=car)
    pictures: queue.Queue[carla.Image] = queue.Queue()
    camera.listen(pictures.put)
    car.apply_control(carla.VehicleControl(throttle=0.6))
    for _ in range(round(2.0 / STEP_S)):
        frame = world.tick()
        picture = pictures.get(timeout=60.0)
        assert picture.frame == frame
    picture.save_to_disk(target)
    velocity = car.get_velocity()
    speed_mps = (velocity.x**2 + velocity.y**2) ** 0.5
    print(f"frame {frame}: {speed_mps:.1f} m/s, picture in {target}")
    camera.stop()
    for actor in (camera, car):
        actor.destroy()


def main() -> None:
    """Run the example."""
    with embedded_server() as (host, port):
        client = carla.Client(host, port)
        client.set_timeout(120.0)  # the first start on a machine compiles
        drive(client, sys.argv[1])


if __name__ == "__main__":
    main()
