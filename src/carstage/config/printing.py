"""The schema as people read it: commented YAML, the reference page, the JSON schema."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import yaml
from pydantic import BaseModel

from carstage.config.model import Config
from carstage.config.presets import RIG_PRESETS
from carstage.config.products import PRODUCTS
from carstage.config.sensors import SENSOR_KINDS, Sensor
from carstage.config.weather import WEATHER_PRESETS
from carstage.sensor_kinds import sensor_kind

Schema = Mapping[str, Any]
_LINE = 100


def config_schema() -> dict[str, Any]:
    """The JSON schema of the configuration; units and form groups are among its keywords."""
    return Config.model_json_schema()


def config_template() -> str:
    """The default configuration as YAML with a comment for each key; it parses to the defaults."""
    lines = [
        "# Car-STAGE configuration. Every key may be left out; these are the defaults.",
        "# What few change stands behind a `#`: take it away to set the key.",
        "# All keys, sensors and attributes: `carstage config schema` and docs/configuration.md.",
        "# What an episode has may be sampled, such as vehicles: {count: {range: [10, 50]}}; see "
        "docs/how-to/campaigns.md.",
    ]
    lines += _template(Config(), config_schema(), 0)
    return "\n".join(lines) + "\n"


def config_reference() -> str:
    """The reference page, docs/configuration.md."""
    schema = config_schema()
    parts = [
        "# Configuration",
        "",
        "<!-- Generated from the schema by `carstage.config.config_reference`; do not edit. -->",
        "",
        "One YAML file says what to record. `carstage config init` prints it with its defaults, "
        "`carstage config check FILE` checks it, `--set key=value` overrides single keys "
        "(`--set fps=20`, `--set rig.sensors[CAM_FRONT].attributes.fov_deg=60`). "
        "Every key may be left out. An unknown key is refused.",
        "",
        *_table(schema, schema, ""),
    ]
    for key, node in schema["properties"].items():
        if key == "rig":
            parts += _rig_reference(schema)
            continue
        shown: dict[str, str] = {}
        for title, section in _sections(key, node, schema):
            name = str(section.get("title"))
            if key == "variants" and title != "variants.KEY":
                continue  # what is below has its own place on the page
            if name in shown:
                parts += ["", f"## {title}", "", f"As `{shown[name]}`."]
                continue
            shown[name] = title
            parts += ["", f"## {title}", "", _text(section), "", *_table(section, schema, "")]
            if key == "weather" and title == "weather":
                parts += ["", f"Presets: {', '.join(f'`{name}`' for name in WEATHER_PRESETS)}."]
    return "\n".join(parts) + "\n"


def _rig_reference(schema: Schema) -> Iterator[str]:
    definitions = schema["$defs"]
    rig = definitions["Rig"]
    yield from ("", "## rig", "", _text(rig), "", *_table(rig, schema, ""))
    yield from ("", "### Presets", "", "| preset | what | source |", "|---|---|---|")
    for name, preset in RIG_PRESETS.items():
        yield f"| `{name}` | {preset.title} | {preset.source} |"
    yield from ("", "### rig.sensors[]", "", "What every sensor has beside its attributes.", "")
    shared = [key for key in Sensor.model_fields if key not in ("kind", "attributes")]
    properties = definitions["ImuSensor"]["properties"]
    section = {**definitions["ImuSensor"], "properties": {key: properties[key] for key in shared}}
    yield from _table(section, schema, "")
    yield from ("", "### rig.sensors[].pose", "", _text(definitions["Pose"]), "")
    yield from _table(definitions["Pose"], schema, "")
    lens = definitions["RgbSensor"]["properties"]["lens"]
    models = next(part for part in lens["anyOf"] if "oneOf" in part)["discriminator"]["mapping"]
    yield from ("", "### rig.sensors[].lens", "", f"Of cameras. {_text(lens)}")
    for model, reference in models.items():
        of_model = _resolve({"$ref": reference}, schema)
        yield from ("", f"#### rig.sensors[].lens: model {model}", "", _text(of_model), "")
        yield from _table(of_model, schema, "")
    yield from _products(definitions["LidarSensor"]["properties"]["product"])
    yield from ("", "### Sensor kinds", "", "| kind | CARLA | what |", "|---|---|---|")
    users: dict[str, list[str]] = {}
    for kind, cls in SENSOR_KINDS.items():
        yield f"| `{kind}` | `{sensor_kind(kind).blueprint}` | {(cls.__doc__ or '').strip()} |"
        attributes = cls.model_fields["attributes"].annotation
        users.setdefault(getattr(attributes, "__name__", ""), []).append(kind)
    yield from ("", "CARLA's own names of attributes are accepted as keys, too.")
    for name, kinds in users.items():
        section = definitions[name]
        yield from ("", f"### Attributes of {', '.join(f'`{kind}`' for kind in kinds)}", "")
        yield from (_text(section), "")
        yield from _table(section, schema, "", carla=True)


def _products(product: Schema) -> Iterator[str]:
    """The key ``product``, and a row for each of its values."""
    yield from ("", "### rig.sensors[].product", "", f"Of LiDARs. {_text(product)}", "")
    yield from (
        "| product | kinds | what | source | otherwise than the product |",
        "|---|---|---|---|---|",
    )
    for name, one in PRODUCTS.items():
        kinds = ", ".join(f"`{kind}`" for kind in one.kinds)
        yield f"| `{name}` | {kinds} | {one.title} | {one.source} | {one.differs} |"


_OF_DRONES = ("path", "gimbal")
"""Sections within a kind of agent that have no other place on the page."""


def _sections(path: str, node: Schema, root: Schema) -> Iterator[tuple[str, Schema]]:
    """The mappings at and below a key, each with its title."""
    if "oneOf" in node:
        lists: dict[str, Schema] = {}  # several kinds may have a list in common
        for tag, reference in node["discriminator"]["mapping"].items():
            section = root["$defs"][reference.rsplit("/", 1)[1]]
            yield f"{path}: kind {tag}", section
            lists |= {
                key: below["items"]
                for key, below in section.get("properties", {}).items()
                if "oneOf" in below.get("items", {})
            }
            for key, below in section.get("properties", {}).items():
                if key in _OF_DRONES:
                    yield from _sections(f"{path}.{key}", below, root)
        for key, items in lists.items():
            yield from _sections(f"{path}.{key}[]", items, root)
        return
    for alternative in node.get("anyOf", [node]):
        section = _resolve(alternative, root)
        if section.get("type") == "array" and "items" in section:
            yield from _sections(f"{path}[]", section["items"], root)
        if section.get("type") == "object" and "properties" in section:
            yield path, section
            for key, below in section["properties"].items():
                yield from _sections(f"{path}.{key}", below, root)
        elif isinstance(section.get("additionalProperties"), dict):
            yield from _sections(f"{path}.KEY", section["additionalProperties"], root)


def _table(section: Schema, root: Schema, prefix: str, *, carla: bool = False) -> list[str]:
    head = "| key | value | default | meaning |"
    lines = [head, "|---|---|---|---|"]
    if carla:
        lines = ["| key | CARLA | value | default | meaning |", "|---|---|---|---|---|"]
    for key, node in section["properties"].items():
        unit = node.get("unit")
        cells = [f"`{prefix}{key}`"]
        if carla:
            cells.append(f"`{node['carla']}`" if "carla" in node else "")
        value = _value(node, root)
        cells.append(f"{value}, {unit}" if unit and unit != "1" else value)
        cells.append(_default(node, key in section.get("required", ())))
        cells.append(_text(node, root))
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return lines


def _default(node: Schema, required: bool) -> str:
    if required:
        return "required"
    if "default" not in node or node["default"] is None:
        return ""
    if isinstance(node["default"], dict):
        return "see below" if node["default"] else "`{}`"
    return f"`{_flow(node['default'])}`"


def _text(node: Schema, root: Schema | None = None) -> str:
    if "description" not in node and root is not None:
        node = _resolve(node, root)  # pydantic leaves out a text that equals its class's
    return " ".join(str(node.get("description", "")).split())


def _resolve(node: Schema, root: Schema) -> Schema:
    if "$ref" in node:
        found: Schema = root["$defs"][node["$ref"].rsplit("/", 1)[1]]
        return found
    return node


def _value(node: Schema, root: Schema) -> str:
    """What may stand for a value, in words."""
    if "oneOf" in node:
        return "section"
    if "anyOf" in node:
        words = [_value(part, root) for part in node["anyOf"]]
        return " or ".join(dict.fromkeys(word for word in words if word != "null"))
    node = {**_resolve(node, root), **{k: v for k, v in node.items() if k != "$ref"}}
    if "const" in node:
        return f"`{node['const']}`"
    if "enum" in node:
        return " or ".join(f"`{word}`" for word in node["enum"])
    kind = node.get("type", "")
    if kind == "array":
        if "prefixItems" in node:
            return "[" + ", ".join(_value(part, root) for part in node["prefixItems"]) + "]"
        return f"list of {_value(node.get('items', {}), root)}"
    words_by_type = {
        "integer": "whole number",
        "number": "number",
        "string": "text",
        "boolean": "`true` or `false`",
        "object": "section" if "properties" in node else "mapping",
        "null": "null",
    }
    return words_by_type.get(str(kind), "value") + _range(node)


def _range(node: Schema) -> str:
    low = node.get("minimum", node.get("exclusiveMinimum"))
    high = node.get("maximum", node.get("exclusiveMaximum"))
    if isinstance(high, int) and high > 10**9:
        high = None
    if low is None and high is None:
        return ""
    low_text = None if low is None else f"{'>' if 'exclusiveMinimum' in node else '≥'} {low:.12g}"
    high_text = (
        None if high is None else f"{'<' if 'exclusiveMaximum' in node else '≤'} {high:.12g}"
    )
    if low_text and high_text and low_text[0] + high_text[0] == "≥≤":
        return f" {low:.12g} to {high:.12g}"
    return " " + " and ".join(text for text in (low_text, high_text) if text)


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False).strip()
    return text.removesuffix("\n...").strip()


def _template(section: BaseModel, root: Schema, depth: int) -> Iterator[str]:
    """The basic keys, each below its comment; then the others on one commented line each."""
    indent = "  " * depth
    properties = root["$defs"].get(type(section).__name__, root)["properties"]
    fields = [(key, value, properties[key]) for key, value in section]
    for key, value, node in fields:
        if not node.get("basic"):
            continue
        yield f"{indent}# {_comment(node, root)}"
        if isinstance(value, BaseModel):
            yield f"{indent}{key}:"
            yield from _template(value, root, depth + 1)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            yield f"{indent}{key}:"
            for item in value:
                dumped = item.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
                yield f"{indent}  - {_flow(dumped)}"
        else:
            yield f"{indent}{key}: {_flow(_plain(value))}"
    for key, value, node in fields:
        if not node.get("basic"):
            yield from _commented(key, value, node, root, indent)


def _commented(key: str, value: Any, node: Schema, root: Schema, indent: str) -> Iterator[str]:
    """A key that few users set: taking away the first `#` of its line makes it count."""
    given = value.model_dump(exclude_none=True) if isinstance(value, BaseModel) else {}
    if given.keys() - {"kind"}:
        yield f"{indent}#{key}:  # {_text(node, root)}"
        properties = root["$defs"][type(value).__name__]["properties"]
        for name, below in value:
            yield from _commented(name, below, properties[name], root, indent + "#  ")
    else:
        shown = given if isinstance(value, BaseModel) else _plain(value)
        line = f"{indent}{'' if indent.endswith('#  ') else '#'}{key}: {_flow(shown)}"
        yield f"{line:<40}  # {_comment(node, root)}"


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _comment(node: Schema, root: Schema) -> str:
    unit = node.get("unit")
    value = _value(node, root).replace("`", "")
    detail = ", ".join(
        part for part in (value, unit) if part and "section" not in part and part != "1"
    )
    text = _text(node, root)
    if "oneOf" in node:
        detail = "kind: " + ", ".join(node["discriminator"]["mapping"])
    return f"{text} [{detail}]" if detail else text
