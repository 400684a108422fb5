"""How much of a radio signal arrives: the path loss models of CARLA's V2X sensors.

Formulas and figures are those of ETSI TR 103 257-1 V1.1.1 (2019-05), which took the WINNER+ ones
(D5.3, 2010), and of the two-ray ground reflection and the single knife edge (ITU-R P.526), as
CARLA 0.9.16 puts them together in ``PathLossModel.cpp``. Losses are dB, powers dBm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from carstage_sim.sensors.attributes import flag, number, require, within

_LIGHT_M_S = 299_792_458.0
_GROUND_PERMITTIVITY = 1.02


class PathState(Enum):
    """What stands between two antennas."""

    LINE_OF_SIGHT = "nothing"
    VEHICLES = "vehicles"
    BUILDINGS = "buildings, or anything else that is no vehicle"


_FADING_DB: Mapping[PathState, Mapping[str, float]] = {
    PathState.LINE_OF_SIGHT: {"highway": 3.3, "urban": 5.2, "rural": 4.25},
    PathState.VEHICLES: {"highway": 3.8, "urban": 5.3, "rural": 4.55},
    PathState.BUILDINGS: {"highway": 6.8, "urban": 6.8, "rural": 6.8},
}
"""Standard deviations of shadow fading: ETSI TR 103 257-1, table 6; rural ones are CARLA's."""

_BOUNDS: Mapping[str, tuple[float, float]] = {
    "transmit_power": (-1000.0, 1000.0),
    "receiver_sensitivity": (-1000.0, 1000.0),
    "frequency_ghz": (0.001, 1000.0),
    "combined_antenna_gain": (-1000.0, 1000.0),
    "path_loss_exponent": (0.0, 100.0),
    "d_ref": (0.001, 1e6),
    "filter_distance": (0.0, 1e6),
    "custom_fading_stddev": (0.0, 1000.0),
}
"""Beyond all radios, and far from where the formulas overflow or divide by nothing."""


@dataclass(frozen=True, slots=True)
class RadioSettings:
    """A V2X sensor's attributes that concern radio waves, with CARLA's names and defaults.

    Attributes:
        transmit_power: dBm that it sends with.
        receiver_sensitivity: dBm that it still hears.
        frequency_ghz: of the carrier.
        combined_antenna_gain: dBi of sender and receiver together.
        scenario: ``highway``, ``rural`` or ``urban``.
        path_loss_model: ``winner`` or ``geometric``.
        path_loss_exponent, d_ref: of the log-distance model behind buildings; ``d_ref`` in metres.
        filter_distance: metres beyond which nothing is heard.
        use_etsi_fading: whether the standard's shadow fading holds.
        custom_fading_stddev: dB of shadow fading that holds else.
    """

    transmit_power: float
    receiver_sensitivity: float
    frequency_ghz: float
    combined_antenna_gain: float
    scenario: str
    path_loss_model: str
    path_loss_exponent: float
    d_ref: float
    filter_distance: float
    use_etsi_fading: bool
    custom_fading_stddev: float

    @classmethod
    def read(cls, attributes: Mapping[str, str]) -> RadioSettings:
        """The settings of a sensor.

        Raises:
            SensorAttributeError: one has an impossible value.
        """
        settings = cls(
            transmit_power=number(attributes, "transmit_power", 21.5),
            receiver_sensitivity=number(attributes, "receiver_sensitivity", -99.0),
            frequency_ghz=number(attributes, "frequency_ghz", 5.9),
            combined_antenna_gain=number(attributes, "combined_antenna_gain", 10.0),
            scenario=attributes.get("scenario", "highway"),
            path_loss_model=attributes.get("path_loss_model", "winner"),
            path_loss_exponent=number(attributes, "path_loss_exponent", 2.7),
            d_ref=number(attributes, "d_ref", 1.0),
            filter_distance=number(attributes, "filter_distance", 500.0),
            use_etsi_fading=flag(attributes, "use_etsi_fading", default=True),
            custom_fading_stddev=number(attributes, "custom_fading_stddev", 0.0),
        )
        for name, (lowest, highest) in _BOUNDS.items():
            within(name, getattr(settings, name), lowest, highest)
        require(
            settings.scenario in ("highway", "rural", "urban"),
            f"scenario is {settings.scenario!r}, not highway, rural or urban",
        )
        require(
            settings.path_loss_model in ("winner", "geometric"),
            f"path_loss_model is {settings.path_loss_model!r}, not winner or geometric",
        )
        return settings

    @property
    def wavelength_m(self) -> float:
        """Of the carrier."""
        return _LIGHT_M_S / (self.frequency_ghz * 1e9)

    def fading_db(self, state: PathState) -> float:
        """Standard deviation of the shadow fading."""
        if not self.use_etsi_fading:
            return self.custom_fading_stddev
        return _FADING_DB[state][self.scenario]


@dataclass(frozen=True, slots=True)
class Edge:
    """The upper edge of a vehicle between two antennas.

    Attributes:
        from_sender_m, to_receiver_m: level distances of the vehicle's middle.
        height_m: of its roof above the lower of the two stations.
    """

    from_sender_m: float
    to_receiver_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class RadioPath:
    """The way between two antennas.

    Attributes:
        distance_m: between the antennas.
        sender_height_m, receiver_height_m: of the antennas above the lower of the two stations.
        state: what stands in between.
        edges: the vehicles in between.
    """

    distance_m: float
    sender_height_m: float
    receiver_height_m: float
    state: PathState
    edges: Sequence[Edge] = ()


def path_loss_db(path: RadioPath, radio: RadioSettings) -> float:
    """Mean loss of a path: what fading scatters about."""
    blocked_db = max((_knife_edge_db(edge, radio.wavelength_m) for edge in path.edges), default=0.0)
    if radio.path_loss_model == "winner":
        return _winner_db(path, radio) + blocked_db
    if path.state is PathState.LINE_OF_SIGHT:
        return _two_ray_db(path, radio.wavelength_m)
    if path.state is PathState.BUILDINGS:
        reference_db = _free_space_db(radio.d_ref, radio.wavelength_m)
        return reference_db + 10.0 * radio.path_loss_exponent * math.log10(
            path.distance_m / radio.d_ref
        )
    return _free_space_db(path.distance_m, radio.wavelength_m) + blocked_db


def _free_space_db(distance_m: float, wavelength_m: float) -> float:
    return 20.0 * math.log10(4.0 * math.pi * distance_m / wavelength_m)


def _winner_db(path: RadioPath, radio: RadioSettings) -> float:
    """ETSI TR 103 257-1, 5.3.1."""
    distance, frequency = math.log10(path.distance_m), math.log10(radio.frequency_ghz)
    if path.state is PathState.BUILDINGS:
        return 36.85 + 30.0 * distance + 18.9 * frequency
    if radio.scenario == "highway":
        return 32.4 + 20.0 * distance + 20.0 * frequency
    return 38.77 + 16.7 * distance + 18.2 * frequency


def _knife_edge_db(edge: Edge, wavelength_m: float) -> float:
    """Loss over one edge (ITU-R P.526, 4.1); CARLA takes the roof's height as the edge's."""
    sender_m, receiver_m = edge.from_sender_m, edge.to_receiver_m
    if sender_m <= 0.0 or receiver_m <= 0.0:
        return 0.0
    v = edge.height_m * math.sqrt(
        2.0 * (sender_m + receiver_m) / (wavelength_m * sender_m * receiver_m)
    )
    if v < -0.78:
        return 0.0
    return 6.9 + 20.0 * math.log10(math.sqrt((v - 0.1) ** 2 + 1.0) + v - 0.1)


def _two_ray_db(path: RadioPath, wavelength_m: float) -> float:
    """The direct ray and the one that the ground reflects, with their phases."""
    lower, upper = path.sender_height_m, path.receiver_height_m
    level_m = math.sqrt(max(path.distance_m**2 - (lower - upper) ** 2, 0.0))
    if level_m == 0.0:
        return _free_space_db(path.distance_m, wavelength_m)
    reflected_m = math.sqrt(path.distance_m**2 + 4.0 * lower * upper)
    sine, cosine = (lower + upper) / reflected_m, level_m / reflected_m
    root = math.sqrt(_GROUND_PERMITTIVITY - cosine**2)
    reflection = (sine - root) / (sine + root)
    phase = 2.0 * math.pi / wavelength_m * (path.distance_m - reflected_m)
    field = math.hypot(1.0 + reflection * math.cos(phase), reflection * math.sin(phase))
    return 20.0 * math.log10(4.0 * math.pi * level_m / (wavelength_m * field))
