"""OpenSCENARIO files are read, and what is beyond is refused with its place in the file."""

from __future__ import annotations

import json
import math

import pytest

from carstage.errors import ConfigError
from carstage.open_scenario import read_storyboard, town_of
from carstage.open_scenario.document import LARGEST_BYTES
from carstage.spec import StoryboardSpec
from carstage.spec.fields import Fields, SpecError
from carstage.spec.storyboard import (
    LanePlace,
    RelativeLanePlace,
    StoryDynamics,
    StoryLaneChange,
    StorySpeed,
    WorldPlace,
)
from storyboard_file import (
    HERO,
    LEAD,
    WALKER,
    after,
    at,
    event,
    group,
    lane_change,
    of,
    pedestrian,
    placed,
    scenario,
    speed,
    vehicle,
    when,
    world,
)

ENTITIES = [vehicle(LEAD), vehicle(HERO, kind="ego_vehicle"), pedestrian(WALKER)]
INIT = [
    placed(LEAD, world(1.0, 2.0, 90.0), 3.0),
    placed(HERO, '<Position><LanePosition roadId="4" laneId="-1" s="7" offset="0.5"/></Position>'),
    placed(
        WALKER,
        '<Position><RelativeLanePosition entityRef="hero" dLane="-1" ds="20"/></Position>',
        1.5,
    ),
]
NEAR = (
    '<RelativeDistanceCondition entityRef="lead" value="20" freespace="true" rule="lessThan" '
    'relativeDistanceType="longitudinal"/>'
)


def read(text: str, **given: object) -> StoryboardSpec:
    return read_storyboard(text.encode(), given)[1]


def group_of_lead(*actions: str, trigger: str = "") -> list[str]:
    return [group(LEAD, event("Go", actions, trigger or when(at(1.0))))]


def test_entities_begin_where_the_file_puts_them_and_the_ego_is_the_first() -> None:
    spec = read(scenario(ENTITIES, INIT, []))
    assert [one.name for one in spec.entities] == [HERO, LEAD, WALKER]
    assert [one.speed_m_s for one in spec.entities] == [0.0, 3.0, 1.5]
    assert spec.entities[0].place == LanePlace(4, -1, 7.0, 0.5, 0.0)
    assert spec.entities[1].place == WorldPlace(1.0, 2.0, 0.0, pytest.approx(90.0))
    assert spec.entities[2].place == RelativeLanePlace(HERO, -1, 20.0, 0.0, 0.0)
    assert spec.entities[2].blueprint == "walker.pedestrian.0001"


def test_openscenarios_own_axes_are_turned_into_carlas() -> None:
    spec = read(scenario(ENTITIES, INIT, [], axes="ours"))
    assert spec.entities[1].place == WorldPlace(1.0, -2.0, 0.0, pytest.approx(-90.0))
    assert spec.entities[0].place == LanePlace(4, -1, 7.0, -0.5, 0.0)
    left = INIT[1].replace('laneId="-1"', 'laneId="1"')
    spec = read(scenario(ENTITIES, [INIT[0], left, INIT[2]], [], axes="ours"))
    assert spec.entities[0].place == LanePlace(4, 1, 7.0, 0.5, 0.0)


def test_a_place_without_a_height_has_none() -> None:
    flat = INIT[0].replace(' z="0.0"', "")
    assert flat != INIT[0]
    spec = read(scenario(ENTITIES, [flat, *INIT[1:]], []))
    assert spec.entities[1].place == WorldPlace(1.0, 2.0, None, pytest.approx(90.0))


def test_events_with_their_triggers_are_read_and_come_back_from_json() -> None:
    events = [
        event("Near", [speed(5.0, "linear", "rate", 2.0)], when(of(HERO, NEAR), delay_s=0.5)),
        event("Over", [lane_change(LEAD, -1, 2.5)], when(after("event", "Near"))),
    ]
    spec = read(scenario(ENTITIES, INIT, [group(LEAD, *events)]))
    first, second = spec.acts[0].groups[0].maneuvers[0].events
    assert first.actions == (StorySpeed("Near0", StoryDynamics("linear", "rate", 2.0), 5.0),)
    assert first.start is not None
    ((condition,),) = first.start
    assert (condition.kind, condition.other, condition.value) == ("relative_distance", LEAD, 20.0)
    assert (condition.measure, condition.freespace, condition.delay_s) == (
        "longitudinal",
        True,
        0.5,
    )
    over = StoryDynamics("sinusoidal", "time", 2.5)
    assert second.actions == (StoryLaneChange("Over0", over, None, -1),)
    document = json.loads(json.dumps(spec.to_json()))
    assert document["kind"] == "storyboard"
    assert StoryboardSpec.read(Fields(document, "scenario"), 10) == spec


def test_a_specification_with_another_word_is_refused_with_its_path() -> None:
    spec = read(scenario(ENTITIES, INIT, group_of_lead(speed(1.0))))
    document = json.loads(json.dumps(spec.to_json()))
    event_of = document["acts"][0]["groups"][0]["maneuvers"][0]["events"][0]
    event_of["start"][0][0]["rule"] = "about"
    path = r"scenario\.acts\[0\]\.groups\[0\]\.maneuvers\[0\]\.events\[0\]\.start\[0\]\[0\]\.rule"
    with pytest.raises(SpecError, match=path):
        StoryboardSpec.read(Fields(document, "scenario"), 10)


def test_parameters_are_put_in_and_may_be_given() -> None:
    declared = '<ParameterDeclaration name="fast" parameterType="double" value="4"/>'
    text = scenario(ENTITIES, INIT, group_of_lead(speed(1.0)), parameters=declared).replace(
        '<AbsoluteTargetSpeed value="1.0"/>', '<AbsoluteTargetSpeed value="$fast"/>'
    )

    def target(**given: object) -> float:
        action = read(text, **given).acts[0].groups[0].maneuvers[0].events[0].actions[0]
        assert isinstance(action, StorySpeed)
        return action.target

    assert target() == 4.0
    assert target(fast=6) == 6.0
    with pytest.raises(ConfigError, match=r"scenario\.params\.slow: .* Declared are: fast"):
        target(slow=6)


def test_the_map_may_be_a_parameter() -> None:
    declared = '<ParameterDeclaration name="town" parameterType="string" value="Stage01"/>'
    text = scenario(ENTITIES, INIT, [], town="$town", parameters=declared).encode()
    for given, expected in (({}, "Stage01"), ({"town": "Stage02"}, "Stage02")):
        assert town_of(text, given) == expected
        assert read_storyboard(text, given)[0] == expected


def test_criteria_of_scenario_runner_and_its_environment_are_passed_over() -> None:
    criterion = (
        '<StopTrigger><ConditionGroup><Condition name="criteria_CollisionTest" delay="0" '
        'conditionEdge="rising"><ByValueCondition><ParameterCondition parameterRef="" value="" '
        'rule="lessThan"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>'
    )
    weather = "<GlobalAction><EnvironmentAction><Environment/></EnvironmentAction></GlobalAction>"
    assert read(scenario(ENTITIES, [weather, *INIT], [], stop=criterion)).stop == ()


BAD_ACTION = "<LongitudinalAction><LongitudinalDistanceAction/></LongitudinalAction>"
COLLISION = of(HERO, '<CollisionCondition><EntityRef entityRef="lead"/></CollisionCondition>')
ACTION = r"/OpenSCENARIO/Storyboard/Story/Act/ManeuverGroup/Maneuver/Event/Action"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (scenario(ENTITIES, INIT, group_of_lead(BAD_ACTION)), rf"line 5, {ACTION}.*Longitudinal"),
        (
            scenario(ENTITIES, INIT, group_of_lead(speed(1), trigger=when(COLLISION))),
            r"EntityCondition/CollisionCondition: <CollisionCondition> is not known .* "
            r"scenario\.scenario_runner",
        ),
        (scenario(ENTITIES[:1], INIT[:1], []), r"Entities: none is the ego"),
        (scenario(ENTITIES, INIT[:2], []), r"Init/Actions: 'walker' has no TeleportAction"),
        (scenario(ENTITIES, [INIT[2], *INIT[:2]], []), r"'hero' .* has no place yet"),
        (scenario([*ENTITIES, ENTITIES[0]], INIT, []), r"two are called 'lead'"),
        (
            scenario([vehicle(HERO, "a_car"), *ENTITIES], INIT, []),
            r"ScenarioObject\[1\]/Vehicle: its name 'a_car' is none of CARLA's",
        ),
        (
            scenario(['<ScenarioObject name="hero"><CatalogReference/></ScenarioObject>'], [], []),
            "catalogs are not read",
        ),
        (
            scenario(ENTITIES, INIT, group_of_lead(speed(1), trigger=when(after("event", "No")))),
            r"Storyboard: a condition names the event 'No', and there is none",
        ),
        (scenario(ENTITIES, INIT, group_of_lead(speed(math.nan))), r"value is 'nan', no number"),
        (scenario(ENTITIES, INIT, group_of_lead(speed(-1.0))), r"value is '-1\.0', no number"),
        (scenario(ENTITIES, INIT, group_of_lead(speed(1e9))), r"value is .* to 150"),
        (
            scenario(ENTITIES, INIT, [group(WALKER, event("Go", [lane_change(WALKER, 1, 2)], ""))]),
            r"not all of its actors can do that",
        ),
        (
            scenario(ENTITIES, INIT, group_of_lead(speed(1, "linear", "rate", 0.0))),
            "a rate of 0 leads nowhere",
        ),
        (
            scenario(ENTITIES, INIT, group_of_lead(speed(1))).replace('"1"/>', '"${1 + 1}"/>'),
            "is an expression",
        ),
        (scenario(ENTITIES, INIT, []).replace('revMajor="1"', 'revMajor="2"'), "version than 1.x"),
    ],
)
def test_what_is_beyond_is_refused_with_its_place(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as raised:
        read(text)
    assert raised.value.message.startswith("scenario.file: line ")
    assert raised.value.hint


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/hostname">]><OpenSCENARIO>&e;'
            "</OpenSCENARIO>",
            "declares a DOCTYPE",
        ),
        (
            '<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb"><!ENTITY c "&b;&b;&b;&b;&b;">]><OpenSCENARIO '
            'name="&c;"/>',
            "declares a DOCTYPE",
        ),
        ("<OpenSCENARIO>" + "<a>" * 200 + "</a>" * 200 + "</OpenSCENARIO>", "within each other"),
        ("<OpenSCENARIO>" + "<a>" * 9000 + "</a>" * 9000 + "</OpenSCENARIO>", "no XML|within"),
        ("<OpenSCENARIO>" + "<a/>" * 30_000 + "</OpenSCENARIO>", "more than 20000 elements"),
        ("<OpenSCENARIO>" + " " * LARGEST_BYTES + "</OpenSCENARIO>", "bytes are more than"),
        ("<OpenDRIVE/>", "its root is <OpenDRIVE>"),
        ("no XML", "it is no XML"),
        ("", "it is no XML"),
        ("<OpenSCENARIO><RoadNetwork/></OpenSCENARIO>", "names no map"),
        (scenario(ENTITIES, INIT, [], town="../../etc/passwd\n"), "names no map"),
    ],
)
def test_hostile_files_are_refused(text: str, message: str) -> None:
    for reads in (lambda: read(text), lambda: town_of(text.encode(), {})):
        with pytest.raises(ConfigError, match=message):
            reads()
