"""What a vehicle's body looks like, as data: curves over the length and a few distances.

All are relative to the body's box: lengths run from -1 (rear) to 1 (front) along x, heights from 0
(ground) to 1 (roof).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from carstage_sim.mesh import Material

Points = tuple[tuple[float, float], ...]
"""Places of a curve."""


class Lamps(Enum):
    """How head lamps look."""

    SWEPT = "a cover that is drawn back round the corner, with two lenses"
    ROUND = "one round lens"
    SQUARE = "an upright cover with one lens over the other"
    STRIP = "a line across the front"


class Tails(Enum):
    """How tail lamps look."""

    SWEPT = "drawn round the corner"
    UPRIGHT = "a column at the edge"
    STRIP = "a line across the rear"


class Bars(Enum):
    """How a grille looks."""

    ACROSS = "bars from side to side"
    UPRIGHT = "slots side by side"
    MESH = "a dark mesh"
    SLOTS = "seven upright openings in the painted sheet"
    VEE = "a dark mesh between two bright arms that lean outwards"


@dataclass(frozen=True, slots=True)
class BodyShape:
    """Outline of a body, relative to its length and height.

    Attributes:
        top: ``(x, z)`` of the middle line: tail, rear window, roof, windscreen, bonnet, nose.
        belt: ``(x, z)`` of the line under the side windows.
        width: ``(x, share)`` of the half width at the belt's height.
        rear_window: x of its lower and upper edge.
        windscreen: x of its upper and lower edge.
        side_glass: x of the side windows' rear and front end.
        pillars: x of the pillars that divide the side windows.
        clearance: height of the floor.
        tumblehome: how far the roof's edge stands in from the belt, as a share of the half width.
        nose_round, tail_round: how far the corners stand back from the middle, in metres.
        nose_lean, tail_lean: how far the top of the face stands back from the bumper, in metres.
        head_lamp: y from, y to (shares of the half width, beyond 1 round the corner), z from, z to.
        tail_lamp: the same at the rear.
        lamps: how the head lamps look.
        tails: how the tail lamps look.
        grille: z from, z to, and half width as a share; None for a closed front.
        bars: how the grille looks.
        intake: z from, z to, and half width as a share of the opening in the bumper.
        boot: whether the rear has a lid under the window; else the whole rear opens.
        faceted: whether the body is of flat sheets that meet in edges.
        cladding: height up to which the sills are bare plastic.
        mirrors: whether outside mirrors reach out to the box's sides.
        rear_glass: z from, z to and half width as a share of a window in an upright rear face.
        tinted: whether the windows behind the front doors are of privacy glass.
        screen_foot: half width of the windscreen's foot, as a share of the body's there.
        tall_mirrors: whether mirrors are upright plates on arms, as a lorry has them.
        rails: whether the roof has rails.
        spare: whether a spare wheel hangs on the rear door.
        leans: ``(x, how far)`` the upper ends of the side windows' edges stand before the lower.
        pillar: material of the pillars.
        roof: material of the cabin above the belt, but for its windows.
        quarter: half width in metres of the painted pillar before a rear quarter window, the
            rearmost one; 0 without such a window.
        rear_pillar: how much wider than the roof's edge the painted pillars beside the rear window
            are, in metres.
        bumper: whether the rear bumper stands out below the lid as a ledge.
    """

    top: Points
    belt: Points
    width: Points
    rear_window: tuple[float, float]
    windscreen: tuple[float, float]
    side_glass: tuple[float, float]
    pillars: tuple[float, ...]
    clearance: float = 0.12
    tumblehome: float = 0.22
    nose_round: float = 0.22
    tail_round: float = 0.16
    nose_lean: float = 0.10
    tail_lean: float = 0.06
    head_lamp: tuple[float, float, float, float] = (0.52, 1.2, 0.40, 0.50)
    tail_lamp: tuple[float, float, float, float] = (0.50, 1.2, 0.48, 0.60)
    lamps: Lamps = Lamps.SWEPT
    tails: Tails = Tails.SWEPT
    grille: tuple[float, float, float] | None = (0.32, 0.44, 0.42)
    bars: Bars = Bars.ACROSS
    intake: tuple[float, float, float] = (0.16, 0.27, 0.72)
    boot: bool = True
    faceted: bool = False
    cladding: float = 0.0
    mirrors: bool = True
    rear_glass: tuple[float, float, float] | None = None
    tinted: bool = False
    screen_foot: float = 0.84
    tall_mirrors: bool = False
    rails: bool = False
    spare: bool = False
    leans: Points = ()
    pillar: Material = Material.PLASTIC_DARK
    roof: Material = Material.PAINT
    quarter: float = 0.0
    rear_pillar: float = 0.05
    bumper: bool = False

    @property
    def rugged(self) -> bool:
        """Whether the body is an SUV's: bare plastic round bumpers, sills and arches."""
        return self.rails or self.spare

    @property
    def rear_pane(self) -> Material:
        """Glass of the windows behind the front doors."""
        return Material.GLASS_TINTED if self.tinted else Material.GLASS


@dataclass(frozen=True, slots=True)
class BodyFrame:
    """Where a body stands in the vehicle's frame (metres).

    Attributes:
        center_x: middle of its length.
        half_length: half its length.
        half_width: half its width without mirrors.
        reach: half its width with mirrors.
        height: of the roof above the ground.
        axles: x of the axles that need an arch.
        wheel_radius: metres; 0 for a body without arches.
        tyre_width: metres.
    """

    center_x: float
    half_length: float
    half_width: float
    reach: float
    height: float
    axles: tuple[float, ...]
    wheel_radius: float
    tyre_width: float
