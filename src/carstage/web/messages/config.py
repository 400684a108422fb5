"""Configuration: schema, the shared draft with its revision, checks, texts."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from carstage.web.messages.base import Document, ErrorMessage, FieldProblem, Message

Author = Annotated[str, StringConstraints(max_length=100)]
Text = Annotated[str, StringConstraints(max_length=1_000_000)]
TextFormat = Literal["yaml", "carla-json"]
ImportFormat = Literal["yaml", "carla-json", "calibration"]


class SchemaGroup(Message):
    """A section of the form."""

    name: str
    title: str


class RigPresetSummary(Message):
    """A rig that ships with Car-STAGE."""

    name: str
    title: str
    source: str


class SchemaMessage(Message):
    """What the form is generated from.

    Attributes:
        config_schema: the JSON schema; fields have ``unit``, ``group``, ``basic``.
        groups: in the order of the form.
        defaults: the default configuration, as the model dumps it.
        demo: the demonstration's configuration.
        sensor_defaults: by kind, a sensor of it with its default attributes.
    """

    config_schema: Document
    groups: list[SchemaGroup]
    rig_presets: list[RigPresetSummary]
    weather_presets: list[str]
    defaults: Document
    demo: Document
    sensor_defaults: dict[str, Document]


class SensorKindMessage(Message):
    """A kind of sensor, as the interface needs to know it.

    Attributes:
        short: beginning of the ids that new sensors of the kind get.
        modality: what it measures with; the interface groups and colours sensors by it:
            ``truth`` is a camera that shows no colours.
        content: what a frame is.
        icon: shape of its mark.
        viewer: what shows a frame; ``none``: numbers, not shown as a picture.
        field_of_view: shape of what it sees; ``none``: it does not look anywhere.
        codecs: names, the default first; empty for what becomes a table.
        since: CARLA's first release that has it.
    """

    name: str
    blueprint: str
    title: str
    short: str
    modality: Literal["camera", "truth", "lidar", "radar", "inertial"]
    content: str
    icon: Literal["camera", "lidar", "radar", "box"]
    viewer: Literal["image", "points", "radar", "none"]
    field_of_view: Literal["pyramid", "cone", "sweep", "none"]
    is_camera: bool
    codecs: list[str]
    since: str


class SensorModality(Message):
    """A group of kinds.

    Attributes:
        colour: name of the page's colour variable, such as ``lidar`` for ``--lidar``.
    """

    name: Literal["camera", "truth", "lidar", "radar", "inertial"]
    title: str
    colour: str


class SensorKindsMessage(Message):
    """All kinds of sensors, those of installed packages too, and their groups in order."""

    kinds: list[SensorKindMessage]
    modalities: list[SensorModality]


class RigPresetMessage(Message):
    """A preset with its sensors, as they would stand in ``rig.sensors``."""

    name: str
    title: str
    source: str
    sensors: list[Document]


class ConfigState(Message):
    """The configuration that all browsers share.

    Attributes:
        rev: grows with each change.
        author: who made the last change, as given with it.
    """

    rev: int
    config: Document
    author: str


class Estimate(Message):
    """What a configuration would record.

    Attributes:
        dataset_bytes: what the dataset takes in the end.
        peak_bytes: the most that is on the disk at once, as the run itself checks it.
        work_bytes: the same where the dataset goes into an object store.
        duration_s: rough wall time on two cores with the embedded simulator.
        disk_free_bytes: where datasets are written.
        fits: whether the run would be begun with that much space.
        fits_elsewhere: the same where the dataset goes into an object store.
    """

    episodes: int
    frames: int
    sensors: int
    hidden_sensors: int
    dataset_bytes: int
    peak_bytes: int
    work_bytes: int
    duration_s: float
    disk_free_bytes: int
    fits: bool
    fits_elsewhere: bool


class ConfigChange(Message):
    """A new configuration in place of revision ``rev``."""

    rev: Annotated[int, Field(ge=0)]
    config: Document
    author: Author = ""


class ConfigSaved(ConfigState):
    """A change that was taken, and what it would record.

    Attributes:
        warnings: what may be meant and still surprises; each begins with the field's path.
    """

    estimate: Estimate | None = None
    warnings: list[str] = Field(default_factory=list)


class ConfigConflict(ErrorMessage):
    """Somebody else changed the configuration; theirs is ``current``."""

    current: ConfigState


class ConfigCheckRequest(Message):
    """A configuration to check without keeping it."""

    config: Document


class ConfigCheck(Message):
    """The verdict over a configuration; ``estimate`` is there when it is right."""

    ok: bool
    errors: list[FieldProblem] = Field(default_factory=list)
    warnings: list[str] = Field(default_factory=list)
    estimate: Estimate | None = None


class ConfigImportRequest(Message):
    """A text to read: a configuration as YAML, a CARLA-style JSON list of sensors, or a calibration
    of KITTI, nuScenes or ROS.

    Attributes:
        base: for a list of sensors: the configuration whose rig they replace.
    """

    text: Text
    format: ImportFormat = "yaml"
    base: Document | None = None


class ConfigImportResult(Message):
    """What the text stands for; ``errors`` when something in it is wrong."""

    config: Document
    errors: list[FieldProblem] = Field(default_factory=list)
    warnings: list[str] = Field(default_factory=list)


class ConfigExportRequest(Message):
    """A configuration (left out: the saved one) to write as text."""

    config: Document | None = None
    format: TextFormat = "yaml"


class ConfigText(Message):
    """A configuration as text, and the name that its file should get."""

    text: str
    file_name: str


class ServerCheckRequest(Message):
    """The section ``server`` of a configuration."""

    server: Document


class ServerCheck(Message):
    """Whether a server can be used.

    Attributes:
        version: the CARLA version that it reports; of an embedded one, that it speaks.
        maps, vehicles: what it offers, as far as it is up.
        client: the Python that has the fitting client wheel.
    """

    ok: bool
    message: str
    hint: str = ""
    version: str | None = None
    maps: list[str] = Field(default_factory=list)
    vehicles: list[str] = Field(default_factory=list)
    client: str | None = None


class ReleaseFolders(Message):
    """Folders of CARLA releases on this machine."""

    folders: list[str]
