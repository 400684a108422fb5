"""scenario_runner plays an OpenSCENARIO file in step with the recording."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import carstage
from carstage.config import check_config
from carstage.errors import ConfigError
from carstage.runs.programs import read_program
from carstage.spec import OpenScenarioSpec
from running_simulator import RunningSimulator
from scenario_runner_folder import scenario_runner

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.xdist_group("following"),
    pytest.mark.timeout(900),
]

LEAD_M_S = 3.0
ENTITY = """
<ScenarioObject name="{name}">
  <Vehicle name="{blueprint}" vehicleCategory="car">
    <ParameterDeclarations/>
    <Performance maxSpeed="70" maxAcceleration="200" maxDeceleration="10"/>
    <BoundingBox><Center x="1.5" y="0" z="0.9"/>
      <Dimensions width="2.1" length="4.5" height="1.8"/></BoundingBox>
    <Axles>
      <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3.1"
                 positionZ="0.3"/>
      <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/>
    </Axles>
    <Properties><Property name="type" value="{type}"/></Properties>
  </Vehicle>
</ScenarioObject>"""
TELEPORT = """
<Private entityRef="{name}">
  <PrivateAction><TeleportAction><Position>
    <WorldPosition x="{x}" y="{y}" z="{z}" h="{h}"/>
  </Position></TeleportAction></PrivateAction>
  <PrivateAction><ControllerAction>
    <AssignControllerAction><Controller name="{name}Driver"><Properties>
      <Property name="module" value="{module}"/></Properties></Controller></AssignControllerAction>
    <OverrideControllerValueAction>
      <Throttle value="0" active="false"/><Brake value="0" active="false"/>
      <Clutch value="0" active="false"/><ParkingBrake value="0" active="false"/>
      <SteeringWheel value="0" active="false"/><Gear number="0" active="false"/>
    </OverrideControllerValueAction>
  </ControllerAction></PrivateAction>
</Private>"""
FILE = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="0" date="2026-01-01T12:00:00" description="CARLA:Lead"
              author=""/>
  <ParameterDeclarations>
    <ParameterDeclaration name="speed" parameterType="double" value="1.0"/>
  </ParameterDeclarations>
  <CatalogLocations/>
  <RoadNetwork><LogicFile filepath="Stage01"/><SceneGraphFile filepath=""/></RoadNetwork>
  <Entities>{entities}</Entities>
  <Storyboard>
    <Init><Actions>{starts}</Actions></Init>
    <Story name="Story"><Act name="Act">
      <ManeuverGroup maximumExecutionCount="1" name="Group">
        <Actors selectTriggeringEntities="false"><EntityRef entityRef="lead"/></Actors>
        <Maneuver name="Maneuver"><Event name="Go" priority="overwrite">
          <Action name="Go"><PrivateAction><LongitudinalAction><SpeedAction>
            <SpeedActionDynamics dynamicsShape="step" value="60" dynamicsDimension="time"/>
            <SpeedActionTarget><AbsoluteTargetSpeed value="$speed"/></SpeedActionTarget>
          </SpeedAction></LongitudinalAction></PrivateAction></Action>
          <StartTrigger><ConditionGroup>
            <Condition name="Now" delay="0" conditionEdge="rising"><ByValueCondition>
              <SimulationTimeCondition value="0" rule="greaterThan"/>
            </ByValueCondition></Condition>
          </ConditionGroup></StartTrigger>
        </Event></Maneuver>
      </ManeuverGroup>
      <StartTrigger><ConditionGroup>
        <Condition name="Start" delay="0" conditionEdge="rising"><ByValueCondition>
          <SimulationTimeCondition value="0" rule="greaterThan"/>
        </ByValueCondition></Condition>
      </ConditionGroup></StartTrigger>
      <StopTrigger><ConditionGroup>
        <Condition name="End" delay="0" conditionEdge="rising"><ByValueCondition>
          <SimulationTimeCondition value="{end_s}" rule="greaterThan"/>
        </ByValueCondition></Condition>
      </ConditionGroup></StopTrigger>
    </Act></Story>
    <StopTrigger/>
  </Storyboard>
</OpenSCENARIO>
"""


def written(path: Path, end_s: float) -> Path:
    """A file in which a car drives away from the ego, which drives as it likes."""
    vehicles = {
        "hero": ("vehicle.lincoln.mkz_2017", "ego_vehicle", "external_control", 0),
        "lead": ("vehicle.tesla.model3", "simulation", "npc_vehicle_control", 30),
    }
    x, y, z, yaw_deg = START
    heading = np.radians(yaw_deg)
    entities = starts = ""
    for name, (blueprint, kind, module, ahead_m) in vehicles.items():
        entities += ENTITY.format(name=name, blueprint=blueprint, type=kind)
        place = (x + ahead_m * np.cos(heading), y + ahead_m * np.sin(heading))
        # A description that begins with "CARLA:" means CARLA's axes.
        starts += TELEPORT.format(name=name, x=place[0], y=place[1], z=z, h=heading, module=module)
    path.write_text(FILE.format(entities=entities, starts=starts, end_s=end_s))
    return path


START = (-188.25, 20.0, 0.3, -90.0)
"""On a straight road of Stage01: x, y, z (m), yaw (deg) in CARLA's axes."""


@pytest.mark.parametrize(("end_s", "drives_on"), [(60.0, True), (2.0, False)])
def test_the_file_moves_the_others_and_the_driver_the_ego(
    simulator: RunningSimulator, tmp_path: Path, end_s: float, drives_on: bool
) -> None:
    runner = scenario_runner()
    config = {
        "seed": 5,
        "fps": 20,
        "duration_s": 4.0,
        "timing": {"warmup_ticks": 2},
        "conversion": {"workers": 1},
        "rig": {"sensors": [{"id": "IMU", "kind": "imu"}]},
        "ego": {"driver": {"kind": "route"}},
        "server": {
            "kind": "remote",
            "host": simulator.host,
            "port": simulator.port,
            "self_test": "off",
        },
        "scenario": {
            "kind": "openscenario",
            "file": str(written(tmp_path / "lead.xosc", end_s)),
            "scenario_runner": str(runner.folder),
            "python": str(runner.python),
            "params": {"speed": LEAD_M_S},
        },
    }
    result = carstage.run(config, tmp_path / "out", retries=0)
    assert not result.failures
    (episode,) = carstage.Dataset(tmp_path / "out").episodes
    assert isinstance(episode.spec.scenario, OpenScenarioSpec)
    assert episode.ego()["speed"].to_pylist()[-1] > 2.0
    rows = [
        row for row in episode.objects().to_pylist() if row["blueprint"] == "vehicle.tesla.model3"
    ]
    speed = np.array([np.linalg.norm(row["velocity"]) for row in rows])
    assert len(speed) == 80
    assert speed[30] > 1.5  # the file's own parameter is 1 m/s
    if drives_on:
        assert abs(speed[60:] - LEAD_M_S).max() < 0.5
    else:
        assert speed[-1] < 0.1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("no XML", r"scenario\.file: it is no XML"),
        ("<OpenDRIVE/>", r"scenario\.file: its root is <OpenDRIVE>"),
        ("<OpenSCENARIO><RoadNetwork/></OpenSCENARIO>", r"scenario\.file: .* names no map"),
        (
            '<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/hostname">]><OpenSCENARIO><RoadNetwork>'
            '<LogicFile filepath="../$town"/></RoadNetwork>&e;</OpenSCENARIO>',
            r"scenario\.file: it declares a DOCTYPE",
        ),
        (
            '<OpenSCENARIO><RoadNetwork><LogicFile filepath="T1"/></RoadNetwork></OpenSCENARIO>',
            r"scenario\.scenario_runner: .* does not hold scenario_runner\.py",
        ),
    ],
)
def test_what_cannot_be_played_is_refused_with_the_setting(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "a.xosc"
    path.write_text(text)
    scenario = {"kind": "openscenario", "file": str(path), "scenario_runner": str(tmp_path)}
    with pytest.raises(ConfigError, match=message):
        read_program(check_config({"scenario": scenario}).scenario)


def test_a_python_without_scenario_runners_packages_is_refused(tmp_path: Path) -> None:
    (tmp_path / "srunner").mkdir()
    (tmp_path / "scenario_runner.py").write_text("")
    path = tmp_path / "a.xosc"
    path.write_text(FILE.format(entities="", starts="", end_s=1))
    scenario = {
        "kind": "openscenario",
        "file": str(path),
        "scenario_runner": str(tmp_path),
        "python": sys.executable,
    }
    with pytest.raises(ConfigError, match=r"scenario\.python: .* lacks what is needed"):
        read_program(check_config({"scenario": scenario}).scenario)
