"""``carla.Client``: versions, files, maps."""

from __future__ import annotations

import tempfile
from pathlib import Path

import carla

from client_api.entries import limited, works
from client_api.surface import has
from client_api.trial_scene import TrialScene, expect


@works("Client.set_timeout", "Client.get_client_version", "Client.get_server_version",
       "Client.get_world", "Client.get_available_maps")  # fmt: skip
def _connecting(scene: TrialScene) -> None:
    """Client and server name the same version; the running town is among the maps."""
    client = scene.client
    client.set_timeout(60.0)
    expect(client.get_client_version() == client.get_server_version(), "versions differ")
    expect(client.get_world().id == scene.world.id, "another world")
    maps = client.get_available_maps()
    name = scene.map.name.rpartition("/")[2]
    expect(any(path.endswith(f"/{name}") for path in maps), f"{name} is not in {maps}")


@works("Client.get_required_files", "Client.request_file", "Client.set_files_base_folder")
def _files(scene: TrialScene) -> None:
    """The navigation mesh is offered, and a download lands in the folder that was set."""
    with tempfile.TemporaryDirectory() as folder:
        scene.client.set_files_base_folder(folder)
        try:
            names = scene.client.get_required_files("Nav", True)
            expect(any(name.endswith(".bin") for name in names), f"files {names}")
            scene.client.request_file(names[0])
            found = [path for path in Path(folder).rglob("*.bin") if path.stat().st_size > 1000]
            expect(bool(found), "nothing was downloaded")
        finally:
            scene.client.set_files_base_folder(str(Path.home() / "carlaCache"))


@works(
    "Client.load_world", "Client.reload_world", "Client.load_world_if_different", own_process=True
)
def _loading(scene: TrialScene) -> None:
    """A load begins a new episode without the old actors; an unknown map is refused."""
    client, name = scene.client, scene.map.name.rpartition("/")[2]
    before = client.get_world()
    blueprint = before.get_blueprint_library().find("vehicle.audi.tt")
    before.spawn_actor(blueprint, before.get_map().get_spawn_points()[0])
    first = before.id
    world = client.reload_world(False)
    expect(world.id != first, "reload_world keeps the episode")
    expect(len(world.get_actors().filter("vehicle.*")) == 0, "the car is still there")
    second = world.id
    world = client.load_world(name, False, carla.MapLayer.NONE)
    expect(world.id != second, "load_world keeps the episode")
    third = world.id
    if has("Client.load_world_if_different"):
        client.load_world_if_different(name, False)
        expect(client.get_world().id == third, "load_world_if_different loads the same map")
    try:
        client.load_world("NoSuchTown")
    except RuntimeError as error:
        expect("not found" in str(error), f"the error reads {error}")
    else:
        raise AssertionError("an unknown map was loaded")
    client.load_world(name, False)


_ROAD = """<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4" name="" version="1">
<geoReference><![CDATA[+proj=tmerc +lat_0=0 +lon_0=0]]></geoReference></header>
<road name="r" length="200" id="1" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView>
<lanes><laneSection s="0"><left><lane id="2" type="sidewalk" level="false"><width sOffset="0" a="2"
b="0" c="0" d="0"/></lane><lane id="1" type="driving" level="false"><width sOffset="0" a="3.5"
b="0" c="0" d="0"/></lane></left><center><lane id="0" type="none" level="false"/></center><right>
<lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
</right></laneSection></lanes></road></OpenDRIVE>"""


@limited("Roads, lights and signs without scenery. Of the parameters `wall_height` and "
         "`enable_pedestrian_navigation` count.",
         "Client.generate_opendrive_world", "OpendriveGenerationParameters.*",
         own_process=True)  # fmt: skip
def _generating(scene: TrialScene) -> None:
    values = carla.OpendriveGenerationParameters()
    values.vertex_distance, values.max_road_length = 2.0, 50.0
    values.additional_width, values.smooth_junctions = 0.6, True
    values.enable_mesh_visibility = True
    for counts in (True, False):
        values.wall_height, values.enable_pedestrian_navigation = float(counts), counts
        world = scene.client.generate_opendrive_world(_ROAD, values, False)
        lane = world.get_map().get_waypoint(carla.Location(100.0, 1.75, 0.0))
        expect(lane.lane_width > 3.0, "the road is not there")
        middle, aside = carla.Location(100.0, 0.0, 0.5), carla.Location(100.0, 40.0, 0.5)
        labels = [point.label for point in world.cast_ray(middle, aside)]
        expect((carla.CityObjectLabel.Walls in labels) == counts, f"beside the road are {labels}")
        names = scene.client.get_required_files("Nav", False)
        expect(bool(names) == counts, f"the files for navigation are {names}")
        houses = world.get_environment_objects(carla.CityObjectLabel.Buildings)
        expect(not houses, f"there are {len(houses)} buildings")
