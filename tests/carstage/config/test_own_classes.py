"""A class of the user's is named, and given arguments, alike for drivers and servers."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from carstage.config.drivers import ClassDriver
from carstage.config.servers import ClassServerConfig


@pytest.mark.parametrize("section", [ClassDriver, ClassServerConfig])
def test_what_cannot_be_a_class_or_an_argument_is_refused(
    section: type[ClassDriver] | type[ClassServerConfig],
) -> None:
    with pytest.raises(ValidationError, match="is not module:Class"):
        section.model_validate({"kind": "class", "name": "no class"})
    with pytest.raises(ValidationError, match="cannot be an argument's name"):
        section.model_validate({"kind": "class", "name": "a:B", "parameters": {"not one": 1}})
