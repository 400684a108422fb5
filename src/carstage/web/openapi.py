"""``python -m carstage.web.openapi``: the OpenAPI document, from which the page's types are made.

The messages of the WebSocket are no routes; their schemas stand among the components.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from pydantic.json_schema import models_json_schema

from carstage.web.app import create_app
from carstage.web.messages import ClientMessage, LiveMessage
from carstage.web.settings import WebSettings

_COMPONENTS = "#/components/schemas/{model}"


def openapi_document() -> dict[str, Any]:
    """The document, with the messages of the WebSocket."""
    document = create_app(WebSettings(roots=(Path(),))).openapi()
    _, live = models_json_schema(
        [(LiveMessage, "serialization"), (ClientMessage, "validation")],
        ref_template=_COMPONENTS,
    )
    schemas = document["components"]["schemas"]
    for name, schema in live["$defs"].items():
        schemas.setdefault(name, schema)
    document["components"]["schemas"] = dict(sorted(schemas.items()))
    return document


def openapi_text() -> str:
    """The document as text, the same on every machine."""
    return json.dumps(openapi_document(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    sys.stdout.write(openapi_text())
