"""A section that names its kind, checked by the model of that kind alone."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import reduce
from operator import or_
from typing import Annotated, Any

from pydantic import (
    Discriminator,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationInfo,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import PydanticKnownError, core_schema

from carstage.config.fields import Section


class OfItsKind:
    """Checks a section by the model of its kind, with the errors that a union would have.

    A union of all models, told apart by ``kind``, says the same. But for that pydantic makes all
    models' checkers: 30 ms of every run for the sensors, of which few runs have more than five
    kinds.

    Args:
        base: of all models; one of its objects is taken as it is.
        models: gives the models by kind; called when there is a section to check.
    """

    def __init__(
        self, base: type[Section], models: Callable[[], Mapping[str, type[Section]]]
    ) -> None:
        self._base = base
        self._models = models

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(self._checked)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        union: Any = Annotated[reduce(or_, self._models().values()), Discriminator("kind")]
        return handler(TypeAdapter(union).core_schema)

    def _checked(self, value: Any, info: ValidationInfo) -> Section:
        if isinstance(value, self._base):
            return value
        if not isinstance(value, dict):
            raise PydanticKnownError("model_attributes_type")
        if "kind" not in value:
            raise PydanticKnownError("union_tag_not_found", {"discriminator": "'kind'"})
        kind, models = value["kind"], self._models()
        if not isinstance(kind, str) or kind not in models:
            raise PydanticKnownError(
                "union_tag_invalid",
                {
                    "discriminator": "'kind'",
                    "tag": str(kind),
                    "expected_tags": ", ".join(map(repr, models)),
                },
            )
        if info.mode == "json":  # lists are what tuples are there
            return models[kind].model_validate_json(json.dumps(value))
        return models[kind].model_validate(value)
