"""Schema, the shared configuration, checks, import and export, presets, connection test."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response

from carstage.web.configure.server_check import release_folders
from carstage.web.messages import (
    ConfigChange,
    ConfigCheck,
    ConfigCheckRequest,
    ConfigConflict,
    ConfigExportRequest,
    ConfigImportRequest,
    ConfigImportResult,
    ConfigSaved,
    ConfigState,
    ConfigText,
    ReleaseFolders,
    RigPresetMessage,
    SchemaMessage,
    SensorKindsMessage,
    ServerCheck,
    ServerCheckRequest,
)
from carstage.web.messages.base import Name
from carstage.web.messages.config import TextFormat
from carstage.web.routes.access import BAD, MISSING, Access

router = APIRouter(prefix="/api", tags=["config"])


@router.get("/schema", responses=BAD)
def schema(services: Access) -> SchemaMessage:
    """What the form is generated from: JSON schema, groups, defaults, presets."""
    return services.schema.message()


@router.get("/sensor-kinds", responses=BAD)
def sensor_kinds(services: Access) -> SensorKindsMessage:
    """The kinds of sensors that a rig may have, and how the interface shows them."""
    return services.schema.sensor_kinds()


@router.get("/config", responses=BAD)
def get_config(services: Access) -> ConfigState:
    """The configuration that all browsers share, with its revision."""
    return services.config.state()


@router.put(
    "/config",
    responses={**BAD, 409: {"model": ConfigConflict, "description": "Somebody was faster."}},
    response_model=ConfigSaved,
)
def put_config(change: ConfigChange, services: Access) -> Response | ConfigSaved:
    """Replace the configuration of revision ``rev``; invalid ones are refused with 422."""
    conflict = services.config.change(change)
    if isinstance(conflict, ConfigConflict):
        return JSONResponse(conflict.model_dump(mode="json"), status_code=409)
    return conflict


@router.post("/config/check", responses=BAD)
def check_config(request: ConfigCheckRequest, services: Access) -> ConfigCheck:
    """Errors by field, warnings, and what it would record; nothing is kept."""
    return services.checker.check(request.config)


@router.post("/config/import", responses=BAD)
def import_config(request: ConfigImportRequest, services: Access) -> ConfigImportResult:
    """Read YAML, or a CARLA-style JSON list of sensors, into a configuration; nothing is kept."""
    return services.texts.read(request)


@router.get("/config/export", responses=BAD, response_class=Response)
def export_saved(services: Access, format: TextFormat = "yaml") -> Response:
    """The saved configuration as a file."""
    text = services.texts.write(ConfigExportRequest(format=format))
    headers = {"Content-Disposition": f'attachment; filename="{text.file_name}"'}
    kind = "application/yaml" if format == "yaml" else "application/json"
    return Response(text.text, media_type=kind, headers=headers)


@router.post("/config/export", responses=BAD)
def export_draft(request: ConfigExportRequest, services: Access) -> ConfigText:
    """A draft as text, for the live text view and for saving."""
    return services.texts.write(request)


@router.get("/presets/rig/{name}", responses=MISSING)
def rig_preset(name: Name, services: Access) -> RigPresetMessage:
    """The sensors of a rig that ships with Car-STAGE."""
    return services.schema.rig_preset(name)


@router.post("/server/check", responses=BAD)
def check_server(request: ServerCheckRequest, services: Access) -> ServerCheck:
    """Whether a server can be used: the connection test. Nothing is started."""
    return services.server_check.check(request.server)


@router.get("/server/releases", responses=BAD)
def releases() -> ReleaseFolders:
    """Folders of CARLA releases on this machine, to choose from."""
    return ReleaseFolders(folders=release_folders())
