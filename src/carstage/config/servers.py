"""On which CARLA server a run records."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, field_validator

from carstage.config.fields import Names, Section, setting
from carstage.config.own_classes import Parameters, checked_class_name, parameters
from carstage.config.supervision import restart_every as _restart_every

Port = Literal["auto"] | Annotated[int, Field(ge=1024, le=65_000)]


def _port(title: str, sentence: str) -> Any:
    return setting("auto", title=title, description=sentence, group="server")


SelfTest = Literal["auto", "on", "off", "require"]


def _self_test() -> Any:
    return setting(
        "auto",
        title="Self-test",
        description="Check the server before the run. `require` refuses one that fails. `auto` "
        "is `on`, but tests the embedded simulator once on a machine.",
        group="server",
    )


def _client_python() -> Any:
    return setting(
        "auto",
        title="Client's Python",
        description="Interpreter with the carla wheel of the server's version; `auto` finds it on "
        "PATH, among pyenv's versions and uv's.",
        group="server",
        min_length=1,
    )


def _create_client_env() -> Any:
    return setting(
        False,
        title="Create the client's Python",
        description="Where `auto` finds none, let uv make an environment with that wheel in the "
        "cache folder.",
        group="server",
    )


class EmbeddedServerConfig(Section):
    """The simulator that ships with Car-STAGE."""

    kind: Literal["embedded"] = setting(
        "embedded",
        title="Server",
        basic=True,
        description="The embedded simulator.",
        group="server",
    )
    port: Port = _port("Port", "First of two ports; `auto` finds free ones.")
    threads: Literal["auto"] | Annotated[int, Field(ge=1, le=1024)] = setting(
        "auto",
        title="Threads",
        description="Threads that draw; `auto`: all cores, of eight and more all but one.",
        group="server",
    )
    maps: Names = setting(
        (),
        title="Maps",
        description="OpenDRIVE files (`My.xodr`), and folders of them, to offer beside the "
        "built-in towns; a file's name is its map's.",
        group="server",
    )
    carla_version: Literal["0.9.13", "0.9.14", "0.9.15", "0.9.16"] = setting(
        "0.9.16",
        title="CARLA version",
        description="The version of CARLA that it speaks and numbers its tags like.",
        group="server",
    )
    wet_grip: Literal["auto", "on", "off"] = setting(
        "auto",
        title="Wet grip",
        description="Whether water on the road takes grip of the tyres. `auto`: not where "
        "variants have weathers of their own.",
        group="server",
    )
    client_python: str = _client_python()
    create_client_env: bool = _create_client_env()
    self_test: SelfTest = _self_test()
    restart_every: int = _restart_every()


class CarlaServerConfig(Section):
    """A CARLA release on this machine, started and stopped by the run."""

    kind: Literal["carla"] = setting(
        title="Server", basic=True, description="CARLA, started by the run.", group="server"
    )
    path: str = setting(
        title="Path",
        description="Folder of the CARLA release, the one with CarlaUE4.sh.",
        group="server",
        min_length=1,
    )
    port: Port = _port("Port", "First of three ports; `auto` finds free ones.")
    arguments: Names = setting(
        ("-RenderOffScreen",),
        title="Arguments",
        description="More arguments of the start script.",
        group="server",
    )
    client_python: str = _client_python()
    create_client_env: bool = _create_client_env()
    self_test: SelfTest = _self_test()
    restart_every: int = _restart_every()


class RemoteServerConfig(Section):
    """A CARLA server that already runs, here or elsewhere; the run does not stop it."""

    kind: Literal["remote"] = setting(
        title="Server", basic=True, description="CARLA that already runs.", group="server"
    )
    host: str = setting(
        "127.0.0.1", title="Host", description="Its address.", group="server", min_length=1
    )
    port: Annotated[int, Field(ge=1, le=65_533)] = setting(
        2000, title="Port", description="Its RPC port.", group="server"
    )
    client_python: str = _client_python()
    create_client_env: bool = _create_client_env()
    self_test: SelfTest = _self_test()


class ClassServerConfig(Section):
    """A class of yours starts another simulator; see docs/how-to/add-a-simulator.md."""

    kind: Literal["class"] = setting(
        title="Server", basic=True, description="A class of yours starts it.", group="server"
    )
    name: str = setting(
        title="Class",
        description="`module:Class`, derived from `carstage.server.Server`.",
        group="server",
        min_length=1,
    )
    folders: Names = setting(
        (".",),
        title="Folders",
        description="Where its module, and its collector's, are looked for after the installed "
        "packages; relative to the working directory.",
        group="server",
    )
    parameters: Parameters = parameters("server")
    restart_every: int = _restart_every()

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        hint = "Write, for example, `my_simulator:MyServer` for class MyServer of my_simulator.py."
        return checked_class_name(name, hint)


ServerConfig = Annotated[
    EmbeddedServerConfig | CarlaServerConfig | RemoteServerConfig | ClassServerConfig,
    Discriminator("kind"),
]
