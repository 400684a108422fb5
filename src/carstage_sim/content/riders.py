"""Riders of motorcycles, scooters and bicycles."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.figures import Dress, add_figure
from carstage_sim.content.lofting import Array, ShapeBuilder
from carstage_sim.content.posing import REST_TOE, Pose
from carstage_sim.content.vehicle_shapes import Build
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material

Vector = tuple[float, float, float]

BICYCLES = (Build.BICYCLE, Build.CITY_BIKE)
_DRESSES = {
    Build.BICYCLE: Dress(
        top="tee", pattern="block", bottom="shorts", hair="helmet", bag="rucksack", fists=True,
        cover=Material.SIGN_WHITE, width=0.96,
    ),
    Build.CITY_BIKE: Dress(
        female=True, top="jacket", hair="helmet", bag="rucksack", fists=True,
        cover=Material.SIGN_WHITE,
    ),
    Build.MOTORCYCLE: Dress(top="shirt", pattern="block", hair="bald", fists=True,
                            hands=Material.PLASTIC_DARK, shoes=Material.PLASTIC_DARK),
    Build.CRUISER: Dress(top="jacket", hair="bald", fists=True, upper=Material.PLASTIC_DARK,
                         hands=Material.PLASTIC_DARK, shoes=Material.PLASTIC_DARK, belly=0.03),
    Build.SCOOTER: Dress(top="jacket", hair="bald", fists=True, hands=Material.PLASTIC_DARK,
                         shoes=Material.SHOE),
}  # fmt: skip


def add_rider(
    builder: ShapeBuilder,
    build: Build,
    low: Vector,
    high: Vector,
    seat: Array,
    grip: Array,
    peg: Array,
) -> None:
    """A rider between seat, grips and pegs whose head touches the top of the box."""
    crown = high[2] - 0.012
    size = float(np.clip((crown - seat[2]) / 0.50, 1.35, 1.80))
    unit = size / 1.80
    lean = {
        Build.BICYCLE: 0.24, Build.CITY_BIKE: 0.08, Build.MOTORCYCLE: 0.26, Build.CRUISER: 0.02,
        Build.SCOOTER: 0.06,
    }[build]  # fmt: skip
    neck_z = crown - 0.27 * unit
    pelvis = seat
    neck = np.array([pelvis[0] + lean, 0.0, neck_z])
    head = np.array([neck[0] + 0.05, 0.0, crown - 0.125 * unit])
    half = min(0.17 * unit, high[1] - 0.06)
    sides: list[dict[str, Array]] = []
    for sign in (-1.0, 1.0):
        mirror = np.array([1.0, sign, 1.0])
        hip = pelvis + np.array([0.0, sign * 0.09 * unit, -0.02])
        down = sign < 0 or build not in BICYCLES
        foot = peg + np.array([0.0, sign * 0.11, 0.0])
        foot[2] += 0.0 if build not in BICYCLES else (-0.10 if down else 0.16)
        ankle = np.array([foot[0] - 0.04, foot[1], max(foot[2] + 0.07, 0.10)])
        knee = (hip + ankle) / 2 + np.array([0.24 * unit, sign * 0.05, 0.06 * unit])
        shoulder = neck + np.array([-0.01, sign * half, -0.07 * unit])
        hand = grip * mirror
        elbow = (shoulder + hand) / 2 + np.array([-0.05, sign * 0.05, -0.08]) * unit
        # Elbows of cyclists stand out as far as the box does, those of others do not leave it.
        room = high[1] - 0.030 * unit
        wide = room if build in BICYCLES else min(abs(elbow[1]), room)
        elbow[1] = sign * wide
        # The fist closes around the grip, ahead of the wrist.
        hand = hand - (hand - elbow) / np.linalg.norm(hand - elbow) * 0.045 * unit
        toe = ankle + np.array([REST_TOE[0], 0.0, REST_TOE[1]]) * unit
        sides.append(
            {
                "hip": hip,
                "knee": knee,
                "ankle": ankle,
                "toe": toe,
                "shoulder": shoulder,
                "elbow": elbow,
                "hand": hand,
            }
        )
    joints = {key: (sides[0][key], sides[1][key]) for key in sides[0]}
    pose = Pose(pelvis=pelvis, neck=neck, head=head, **joints)
    motor = build not in BICYCLES
    add_figure(builder, pose, _DRESSES[build], size, CityObjectLabel.RIDER)
    if motor:
        _add_full_helmet(builder, head, unit)


def _add_full_helmet(builder: ShapeBuilder, head: Array, unit: float) -> None:
    """A helmet that closes round the chin, with a dark visor, in the machine's colour."""
    up = np.array([0.0, 0.0, 1.0]) * unit
    rings = head + up * np.array([-0.125, -0.09, -0.02, 0.06, 0.105, 0.122])[:, None]
    builder.limb(
        rings, np.array([0.07, 0.098, 0.112, 0.104, 0.07, 0.02]) * unit, Material.PAINT, sides=12,
        squash=1.15, tag=CityObjectLabel.RIDER,
    )  # fmt: skip
    turn = np.radians(np.linspace(-62.0, 62.0, 7))
    rows = []
    for z, away in ((-0.045, 0.112), (-0.01, 0.118), (0.035, 0.113)):
        x = head[0] + away * 1.16 * unit * np.cos(turn)
        y = away * 1.01 * unit * np.sin(turn)
        rows.append(np.stack([x, y, np.full_like(x, head[2] + z * unit)], axis=-1))
    builder.grid(np.stack(rows), Material.GLASS_DARK, tag=CityObjectLabel.RIDER)
