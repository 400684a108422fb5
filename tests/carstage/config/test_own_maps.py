"""OpenDRIVE files of the user: named in the configuration, refused early where they are none."""

from __future__ import annotations

from pathlib import Path

import pytest

from carstage.config import Config, parse_config
from carstage.config.own_maps import own_maps
from carstage.errors import ConfigError
from carstage.files.hashing import hash_of
from carstage.plan import ServerFacts, plan_episodes
from carstage.runs.preflight import check_before_server
from carstage.runs.servers import embedded_facts, make_server
from carstage.server import EmbeddedServer

TEXT = "<OpenDRIVE>\n</OpenDRIVE>\n"


@pytest.fixture
def town(tmp_path: Path) -> Path:
    path = tmp_path / "towns" / "My.xodr"
    path.parent.mkdir()
    path.write_text(TEXT, encoding="utf-8")
    return path


def chosen(path: Path, more: str = "") -> Config:
    return parse_config(f"{{map: '{path}'{more}}}")


def test_a_file_as_the_map_is_offered_under_its_name(town: Path) -> None:
    config = chosen(town)
    check_before_server(config)
    found = own_maps(config)
    assert {name: one.path for name, one in found.items()} == {"My": town}
    server = make_server(config, None)
    assert isinstance(server, EmbeddedServer)
    words = server._command()
    assert words[words.index("--maps") + 1] == str(town)


def test_a_folder_offers_all_of_its_files(town: Path) -> None:
    (town.parent / "Other.xodr").write_text(TEXT, encoding="utf-8")
    config = parse_config(f"{{map: My, server: {{kind: embedded, maps: ['{town.parent}']}}}}")
    assert set(own_maps(config)) == {"My", "Other"}


def test_an_episode_names_the_text_of_its_map(town: Path) -> None:
    config = chosen(town)
    facts = embedded_facts("0.9.16", own_maps(config), lambda *_: 3)
    (first,) = plan_episodes(config, facts)
    assert (first.map, first.opendrive) == ("My", hash_of(TEXT.encode()))
    town.write_text(TEXT + " ", encoding="utf-8")
    (second,) = plan_episodes(config, embedded_facts("0.9.16", own_maps(config), lambda *_: 3))
    assert second.episode_id != first.episode_id


def test_an_episode_of_a_servers_map_names_no_text() -> None:
    (spec,) = plan_episodes(parse_config("map: Stage01"), ServerFacts(maps={"Stage01": 9}))
    assert "opendrive" not in spec.to_json()


def test_line_ends_of_a_file_are_those_that_a_client_gets(town: Path) -> None:
    town.write_bytes(TEXT.replace("\n", "\r\n").encode())
    assert own_maps(chosen(town))["My"].opendrive == hash_of(TEXT.encode())


def test_sampled_files_are_offered(town: Path) -> None:
    other = town.with_name("Other.xodr")
    other.write_text(TEXT, encoding="utf-8")
    config = parse_config(f"map: {{choice: ['{town}', '{other}', Stage01]}}")
    assert set(own_maps(config)) == {"My", "Other"}


def refusal(config: Config) -> str:
    with pytest.raises(ConfigError) as refused:
        check_before_server(config)
    assert refused.value.hint
    return str(refused.value)


def offering(*paths: Path) -> Config:
    given = ", ".join(f"'{path}'" for path in paths)
    return parse_config(f"server: {{kind: embedded, maps: [{given}]}}")


def test_what_is_no_map_is_refused_with_its_path(town: Path, tmp_path: Path) -> None:
    empty, note = tmp_path / "empty", tmp_path / "note.txt"
    empty.mkdir()
    note.write_text("x")
    assert "map.choice: " in refusal(chosen(tmp_path / "no.xodr"))
    assert "server.maps[1]: " in refusal(offering(town, empty))
    assert "server.maps[0]: " in refusal(offering(note))
    town.write_bytes(b"\xff\xfe")
    assert "not UTF-8" in refusal(offering(town))


def test_two_files_of_one_name_must_be_equal(town: Path, tmp_path: Path) -> None:
    copy = tmp_path / town.name
    copy.write_text(TEXT, encoding="utf-8")
    assert set(own_maps(offering(town, copy))) == {"My"}
    copy.write_text(TEXT + " ", encoding="utf-8")
    assert "server.maps[1]: " in refusal(offering(town, copy))


def test_a_file_named_like_a_built_in_town_is_refused(town: Path) -> None:
    config = offering(town.rename(town.with_name("Stage01.xodr")))
    with pytest.raises(ConfigError, match=r"server\.maps\[0\]: Stage01 is a built-in town"):
        embedded_facts("0.9.16", own_maps(config), lambda *_: 3)


def test_a_file_of_which_no_town_can_be_made_is_refused(town: Path) -> None:
    with pytest.raises(ConfigError, match=r"map\.choice: no town can be made of"):
        embedded_facts("0.9.16", own_maps(chosen(town)))


@pytest.mark.parametrize("server", ["{kind: remote}", "{kind: carla, path: /opt/carla}"])
def test_other_servers_load_no_file(server: str) -> None:
    with pytest.raises(ConfigError, match=r"map\.choice: .* loads no file"):
        parse_config(f"{{map: towns/My.xodr, server: {server}}}")
