"""Records of the rod's kernels: tabulated response and fading, scratch of a step, a wound rod.

Of a wound rod: constants, state, what drives and holds it, and how an advance ends.
"""

from typing import NamedTuple

import numpy as np

from cable_fem_node.dynamics.state import ContactLaw, FloatArray, IntArray
from winding_core.cable.material_law import TABLE_HIGH, TABLE_INTERVALS, TABLE_LOW, MaterialLaw
from winding_core.cable.prony import PronySeries

# Points of the law's inverse, and of the table that it is read from: strains are exact to 1e-6.
_POINTS, _FINE = 8193, 65537
_LOWEST_STRETCH = 0.5
# Why an advance stopped.
RUNNING = 0
FULL = 1
DIVERGED = 2
EMPTY = 3
STIRRED = 4
LOOK = 5
# Motion over the surface that resting cable must follow where cable lies on cable, which gives way
# for as long as it is wound over: a thousandth of the distance of centre lines. It is promised a
# hundredth a layer.
STIRRED_ON_CABLE = 1.0e-3
# An element is cut from the span's last one at this many segment lengths, given back below that.
CUT_AT = 1.6
MERGE_AT = 0.4


class AxialResponse(NamedTuple):
    """Tabulated axial response of a section."""

    table: FloatArray  # see `MaterialLaw.table`
    low: float  # stretch at the table's begin
    per_spacing: float  # intervals per unit of stretch
    area: float  # that carries tension [m^2]


class Relaxation(NamedTuple):
    """How the axial force of an element fades; without terms it does not."""

    share: FloatArray  # (terms,) g
    time: FloatArray  # (terms,) tau [s]
    strain: FloatArray  # (points,) of the law, over a uniform grid of forces
    low: float  # first force [N]
    per_spacing: float  # points per force [1/N]
    high: float  # last force [N]


class Work(NamedTuple):
    """Scratch of one step; column i is node i or the element from node i on."""

    tangent: FloatArray  # (3, capacity)
    inverse: FloatArray  # (capacity,) inverse lengths [1/m]
    tension: FloatArray  # (capacity,) [N]
    cosine: FloatArray  # (capacity,) of the turning angles
    slope: FloatArray  # (capacity,) dE/dcosine [J]
    force: FloatArray  # (3, capacity) what each element passes on [N]
    net: FloatArray  # (3, capacity) on each node [N]
    couple: FloatArray  # (capacity,) about the cable's axis [N m]


def axial_response(law: MaterialLaw, area: float) -> AxialResponse:
    """Tabulate a law for a section that carries tension on an area [m^2]."""
    spacing = TABLE_INTERVALS / (TABLE_HIGH - TABLE_LOW)
    return AxialResponse(law.table(), TABLE_LOW, spacing, area)


def relaxation(law: MaterialLaw, area: float, series: PronySeries) -> Relaxation:
    """Tabulate the inverse of a law for a section that carries tension on an area [m^2]."""
    stretch = np.linspace(_LOWEST_STRETCH, min(law.limit()[1], TABLE_HIGH), _FINE)
    force = area * law.nominal_stress(stretch)
    grid = np.linspace(force[0], force[-1], _POINTS)
    return Relaxation(
        share=np.array(series.shares, dtype=float),
        time=np.array(series.times, dtype=float),
        strain=np.interp(grid, force, stretch) - 1.0,
        low=float(grid[0]),
        per_spacing=(_POINTS - 1) / float(grid[-1] - grid[0]),
        high=float(grid[-1]),
    )


class Constants(NamedTuple):
    """Numbers that stay the same during a run (SI)."""

    segment: float
    mass: float
    bending: float
    touch: ContactLaw
    damping_rate: float
    start_radius: float
    contact_line: float
    free_length: float
    roll_inertia: float
    torsion: float
    late: int  # landings after which friction holds a node along the circumference, beside its own
    stirred: float  # motion over the surface that resting cable must follow [m]
    rolling: bool  # whether the cable may roll on the surface about its own axis


# Rows of the state: what `points_of` takes, the reference lengths of the elements, and where the
# cable relaxes the elements' elastic force and one viscous force per term.
STATE_ROWS = 12
REFERENCE = 11
VISCOUS = 12


class RodState(NamedTuple):
    """Integrated nodes and elements of a rod, and how the cylinder holds the first node.

    Few arrays and one record are passed to a kernel quickly.
    """

    nodes: int  # in use
    rows: FloatArray  # (STATE_ROWS and more, capacity), changed
    touching: IntArray  # (capacity,) 1 where a node is in contact, changed
    below: FloatArray  # cable that nodes may lie on, see `Points`
    room: FloatArray  # (3, capacity) square of the radius [m^2] down to which, and z [m] from which
    # to which a node may move before cable below is looked up anew; (0, capacity) for anywhere
    way: float  # over the surface, the same [m]
    tie: FloatArray  # (3, 3) rows TIE_PLACE .. TIE_WATCHED in the frame of the cylinder
    tie_length: float  # that bends about the first node, twice the mean of both sides [m]
    watched: int  # node whose motion over the surface ends the advance; 0 for none


class Advance(NamedTuple):
    """How an advance of the rod ended."""

    nodes: int  # in use
    steps: int  # taken
    surface_rate: float  # angular speed of the cylinder in the last step [rad/s]
    status: int  # RUNNING .. LOOK
    element: int  # at fault


# Rows of the drive: value at the beginning, value at the end of the advance.
ANGLE, SPEED, GUIDE, FEED, TENSION, STRETCH, LANDING, EYE_X, EYE_Y = range(9)

# Rows of the tie, in the frame of the cylinder: place of node 0, direction of the cable there,
# place of the node that is watched.
TIE_PLACE, TIE_ALONG, TIE_WATCHED = range(3)


def part_way(drive: FloatArray, u: float, span: float) -> FloatArray:
    """Return the drive with its first column moved to the share u of the way."""
    part = drive.copy()
    for value, slope in ((ANGLE, SPEED), (GUIDE, FEED)):
        a, b = drive[value]
        da, db = drive[slope] * span
        step = b - a
        second, third = 3.0 * step - 2.0 * da - db, da + db - 2.0 * step
        part[value, 0] = a + u * (da + u * (second + u * third))
        part[slope, 0] = (da + u * (2.0 * second + 3.0 * u * third)) / span
    for value in (TENSION, STRETCH, LANDING, EYE_X, EYE_Y):
        part[value, 0] = drive[value, 0] + u * (drive[value, 1] - drive[value, 0])
    return part
