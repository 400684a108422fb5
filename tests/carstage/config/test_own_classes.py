"""A class of the user's is named, and given arguments, alike for drivers and servers."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from carstage.config import parse_config
from carstage.config.drivers import ClassDriver
from carstage.config.servers import ClassServerConfig
from carstage.errors import ConfigError


@pytest.mark.parametrize("section", [ClassDriver, ClassServerConfig])
def test_what_cannot_be_a_class_or_an_argument_is_refused(
    section: type[ClassDriver] | type[ClassServerConfig],
) -> None:
    with pytest.raises(ValidationError, match="is not module:Class"):
        section.model_validate({"kind": "class", "name": "no class"})
    with pytest.raises(ValidationError, match="cannot be an argument's name"):
        section.model_validate({"kind": "class", "name": "a:B", "parameters": {"not one": 1}})


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (
            "ego: {driver: {kind: class, name: 'a:B', parameters: {at: %s}}}",
            "ego.driver.parameters",
        ),
        ("server: {kind: class, name: 'a:B', parameters: {at: %s}}", "server.parameters"),
        ("scenario: {kind: scenic, file: x.scenic, params: {at: %s}}", "scenario.params"),
    ],
)
@pytest.mark.parametrize("value", ["[1, 5]", "null", "{b: 1}"])
def test_an_argument_is_a_plain_value(text: str, place: str, value: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config(text % value)
    told = value.replace("null", "None").replace("b:", "'b':")
    assert caught.value.message == (
        f"{place}.at: {told} is no word, no number, and not true or false."
    )
