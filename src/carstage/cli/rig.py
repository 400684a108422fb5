"""`carstage rig`: rigs out of the calibrations of others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from carstage.cli.output import Debug, Json, command, note, result, result_json
from carstage.errors import BadInputError

rig_app = typer.Typer(help="Rigs out of the calibrations of others.", no_args_is_help=True)


@rig_app.command("import")
@command
def rig_import(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="KITTI's calib file, nuScenes' calibrated_sensor.json and sensor.json, ROS's "
            "camera_info in YAML, or Kalibr's camchain.",
            metavar="FILE...",
        ),
    ],
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Print the section `rig` of a configuration for a calibration, with camera models."""
    del debug
    import yaml

    from carstage.web.configure.calibrations import read_calibration

    read = read_calibration(_text(files))
    for warning in read.warnings:
        note(f"warning: {warning}")
    if json:
        result_json({"sensors": read.sensors, "warnings": read.warnings})
    else:
        document = {"rig": {"sensors": read.sensors}}
        result(yaml.safe_dump(document, default_flow_style=None, sort_keys=False).rstrip())


def _text(files: list[Path]) -> str:
    """One text; of several files of JSON an object by file name, of others one after another."""
    import json

    texts = [_read(path) for path in files]
    if len(files) > 1 and all(path.suffix == ".json" for path in files):
        parts = zip(files, texts, strict=True)
        entries = ", ".join(f"{json.dumps(path.name)}: {text}" for path, text in parts)
        return "{" + entries + "}"
    return "\n---\n".join(texts)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise BadInputError(
            f"{path} cannot be read: {error.strerror}.", "Name the files of a calibration."
        ) from error
