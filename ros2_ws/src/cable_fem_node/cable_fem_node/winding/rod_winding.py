"""Live model of a winding run: the rod between the turning cylinder and the guide.

Lab frame: cylinder axis +z, contact line at azimuth zero, the span comes from the -y side in the
plane x = R + r; P0 stands at azimuth Theta, z = 0.
"""

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.contact_springs import (
    contact_energy,
    lying_energy,
    normal_forces,
    springs,
    stable_step,
)
from cable_fem_node.dynamics.state import (
    LOSS_RELAXATION,
    WORK_SURFACE,
    WORK_TIE,
    DivergenceError,
    EnergyLedger,
    FloatArray,
    ImpossibleResultError,
    Points,
)
from cable_fem_node.rod.rod_records import (
    ANGLE,
    DIVERGED,
    EMPTY,
    FULL,
    LANDING,
    LOOK,
    RUNNING,
    STIRRED,
    STIRRED_ON_CABLE,
    TENSION,
    Advance,
    part_way,
)
from cable_fem_node.winding import resting_cable
from cable_fem_node.winding.resolved_model import STEP_SAFETY, STILL_SHARE, STIRRED_SHARE
from cable_fem_node.winding.resting_cable import Fading, turned
from cable_fem_node.winding.rod_nodes import WATCHED, RodNodes, WholeRod, kinetic_energy
from cable_fem_node.winding.stillness import AWAKE_FOR, Stillness
from cable_fem_node.winding.validity import refuse, rod_checks
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_kernels import advance_winding
from cable_fem_node.winding.winding_model import NODE_DTYPE, WindingModel
from cable_fem_node.winding.wound_surface import AHEAD, TURN, WoundSurface, reach, unrolled
from winding_core.cable.material_law import TABLE_HIGH, TABLE_LOW
from winding_core.machine.readings import GuidePlace
from winding_core.markers import Markers
from winding_core.units import MILLIMETRE

# Nodes that are laid and nevertheless integrated, counted from the landing point: waves of a noisy
# load have decayed over them to a ten-thousandth.
AWAKE = 20
# By at least so many nodes the border moves when cable comes to rest, and by so many when it wakes.
FEWEST_TO_REST = 8
WOKEN = 16
# The same where cable lies on cable. There no more stay awake than lie beside none of themselves,
# whose springs would need half the step, but so many do; two more come between two looks.
FEWEST_ON_CABLE, AWAKE_ON_CABLE, LANDED = 4, 6, 3
# What falls off cable, faster across its way than the surface goes (0.5 to 0.8 of which have nodes
# that land), moves by such a share of the distance of centre lines in a step; steps may be such a
# share of the bare cylinder's, and are half of them for a while after it, and beside bare flanges.
FALL, SHORTEST, RESTLESS = 5.0e-4, 0.1, 0.5


class RodWinding(WindingModel):
    """The live rod: advanced along the machine's measured or planned motion.

    Turns that lie still on the cylinder rest: they turn with it and are not integrated until
    something moves the cable next to them.

    Raises:
        ValueError: The rod cannot be right about it; the sentence names the number and a remedy.
    """

    def __init__(self, config: WindingConfig) -> None:
        refuse(rod_checks(config.resolved))
        super().__init__(config)
        resolved = config.resolved
        self._constants = resolved.constants
        self._axial, self._relaxation = resolved.axial, resolved.relaxation
        self.step_limit = resolved.step
        self._relaxes = bool(config.case.material.prony.shares)
        guide = GuidePlace.beside(self._constants.contact_line, config.free_length)
        self._nodes = self._straight(guide)
        self._surface_rate = 0.0
        self._bare = 1.0 if config.drum is None else RESTLESS
        self._last_step, self._share, self._restless = self.step_limit, self._bare, 0.0
        on_cable = STILL_SHARE / STIRRED_SHARE * STIRRED_ON_CABLE * resolved.constants.touch.apart
        self._stillness = Stillness(resolved.still, on_cable)
        self._wound = WoundSurface(self._constants.touch.apart)
        self._free = self._nodes.total - 1  # Nodes of the span
        turn = int(math.tau * resolved.wound_radius / (resolved.segment * resolved.stretch))
        beside = turn - WATCHED - FEWEST_ON_CABLE - LANDED
        self._beside = min(AWAKE, max(beside, AWAKE_ON_CABLE)), FEWEST_ON_CABLE
        self._initial_energy = self._stored(self._whole())

    def _straight(self, guide: GuidePlace) -> RodNodes:
        """Return nodes of a straight span from P0 to the guide."""
        resolved, k = self.config.resolved, self._constants
        span, stretch = math.hypot(guide.x - k.contact_line, guide.y), resolved.stretch
        count = max(3, round(span / (stretch * resolved.segment)))
        along = np.arange(count + 1) * resolved.segment * stretch
        along[-1] = span
        position = np.zeros((3, count + 1))
        position[0] = k.contact_line + along * ((guide.x - k.contact_line) / span)
        position[0, 0] = k.start_radius
        position[1] = along * (guide.y / span)
        return RodNodes(
            position,
            np.diff(along) / stretch,
            Fading.of(resolved) if self._relaxes else None,
            resolved.elastic_tension(stretch),
        )

    def _begin_at(self, guide: GuidePlace) -> None:
        self._nodes = self._straight(guide)
        self._initial_energy = self._stored(self._whole())

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return self._nodes.total

    def compile(self) -> None:
        """See `WindingModel.compile`."""
        super().compile()
        self._wound.compile()

    @property
    def live_nodes(self) -> int:
        """Number of nodes that are integrated; the others rest on the cylinder."""
        return self._nodes.live

    def markers(self) -> Markers:
        """Return the records of P0..Pn; those not yet on the cylinder carry NOT_WOUND."""
        resting = self._nodes.resting
        case = self.config.case
        if resting.row(resting_cable.ARC)[-1] >= case.marker_count * case.marker_spacing:
            s, theta, z = (resting.row(row) for row in resting_cable.PATH)
            return self._marker_records(s, theta, z, math.inf, self._raised(resting.count))
        s, theta, z = self._nodes.path()
        first = resting.count - 1
        wound_to = float(s[self._laid_nodes() - 1])
        records = self._marker_records(s, theta, z, wound_to, self._raised(self.nodes))
        self._place_loose(records, s[first:], self._nodes.position)
        return records

    def cable(self) -> NDArray[np.void]:
        """Return the nodes as records of NODE_DTYPE, see `WindingModel.cable`."""
        return self._records(0)

    def newest_cable(self, turns: float) -> NDArray[np.void]:
        """Return the cable's end, see `WindingModel`; what is left out costs nothing."""
        resting = self._nodes.resting
        _, theta, _ = self._nodes.path()
        oldest = float(theta[self._laid_nodes() - 1]) - math.tau * turns
        begin = int(np.searchsorted(resting.row(resting_cable.THETA), oldest))
        return self._records(min(begin, resting.count - 1))

    def stretch(self) -> FloatArray:
        """Return the stretch of every element, shape (nodes - 1,)."""
        return self._stretch_from(0)

    def tension(self) -> FloatArray:
        """Return the tension [N] of every element, shape (nodes - 1,)."""
        return self._tension_from(0, self.stretch())

    def wound_path(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (s reference arc length [m], theta [rad], z [m]) of the laid nodes from P0 on."""
        laid = self._laid_nodes()
        s, theta, z = self._nodes.path()
        return s[:laid].copy(), theta[:laid].copy(), z[:laid].copy()

    def wound_stretch(self) -> float:
        """Return the mean stretch of the laid elements; of the first before any is laid.

        The outermost ones count from when their outer node is held: until then they are landing.
        """
        stretch = self.stretch()
        laid = self._nodes.laid()
        since = max(laid - 1 - self._constants.late, 0)
        landing = int((self._nodes.points.slip[0, since:laid] == 0.0).sum())
        wound = stretch[: max(self._laid_nodes() - 1 - landing, 0)]
        return float(wound.mean()) if wound.size else float(stretch[0])

    def contact_forces(self) -> FloatArray:
        """Return with which force cylinder, cable, flanges push every node [N], shape (nodes,)."""
        return normal_forces(self._whole().cable, self._constants.touch)

    @property
    def energy(self) -> EnergyLedger:
        """The energy ledger since the start."""
        k = self._constants
        self._ledger[LOSS_RELAXATION] += self._nodes.resting.fade(self.time)
        whole = self._whole()
        cable = whole.cable
        entries = self._ledger.copy()
        # What rests is driven by the surface alone: its energy of motion is the work of the tie.
        entries[WORK_TIE] += self._kinetic(cable, self._nodes.resting.count)
        return EnergyLedger.of(
            entries,
            kinetic=self._kinetic(cable, self.nodes - 1),
            internal=self._stored(whole),
            contact=contact_energy(cable, k.touch),
            initial=self._initial_energy,
        )

    def _run(self, t: float, span: float, drive: FloatArray) -> None:
        if self._relaxes:
            faded = float(self._nodes.viscous[1:, self._nodes.live - 2].sum())
            drive[LANDING, 1] = self.config.resolved.crept_landing(drive[TENSION, 1], faded)
        k, nodes = self._constants, self._nodes
        left, done, total, part, share = span, 0, 0, drive, 0.0
        while not total or done < total:
            beside = nodes.below.size
            if self._share != share:
                share = self._share
                done, total = 0, max(1, math.ceil(left / (share * self.step_limit)))
                dt = left / total
            end = Advance(
                *advance_winding(
                    nodes.rod,
                    total - done,
                    dt,
                    self._last_step,
                    self._surface_rate,
                    part,
                    k,
                    self._axial,
                    self._relaxation,
                    self._ledger,
                )
            )
            nodes.live, self._surface_rate = end.nodes, end.surface_rate
            self._last_step = dt if end.steps else self._last_step
            done += end.steps
            self.element_steps += end.steps * (nodes.live - 1)
            broken = () if end.status in (RUNNING, LOOK) else np.flatnonzero(nodes.beyond_tables())
            if end.status == DIVERGED or len(broken):
                raise DivergenceError(
                    f"the winding diverged before t = {t:.6g} s at element "
                    f"{nodes.resting.count - 1 + max((end.element, *broken[:1]))} of "
                    f"{self.nodes - 1}: "
                    f"its stretch left {TABLE_LOW:g} to {TABLE_HIGH:g} "
                    f"(step {dt:.3g} s, tension {drive[TENSION, 1]:.4g} N)"
                )
            if end.status == EMPTY and nodes.resting.count == 1:
                raise DivergenceError(
                    f"the span was pulled back to the cylinder before t = {t:.6g} s: "
                    "no element left"
                )
            if beside and nodes.touching[nodes.live - 2]:
                raise ImpossibleResultError(self._reached(t))
            lying = self._lying() if end.status != RUNNING else 0.0
            before = part[ANGLE, 0]
            if end.status != RUNNING:
                part = part_way(part, end.steps * dt / left, left)
                left -= end.steps * dt
            nodes.way -= k.contact_line * abs(part[ANGLE, int(end.status == RUNNING)] - before)
            if end.status == FULL:
                nodes.grow(2 * nodes.live)
            elif end.status in (STIRRED, EMPTY):
                self._wake(t, t - left, float(part[ANGLE, 0]))
            if end.status != RUNNING:
                self._find_below(lying)
        awake, fewest = self._beside if nodes.below.size else (AWAKE, FEWEST_TO_REST)
        enough = nodes.live >= self._free + awake + WATCHED + fewest
        if enough and self.config.rests and self._stillness.due(t):
            self._look(t, float(drive[ANGLE, 1]), awake, fewest)

    def _reached(self, t: float) -> str:
        """Return the sentence about cable that lies up to the guide before a time [s]."""
        x, y, _ = self._nodes.position[:, -2:]
        lies, stands = np.hypot(x, y) / MILLIMETRE
        return (
            f"the cable lies up to the guide before t = {t:.6g} s: {lies:.4g} mm from the axis, "
            f"from which the guide stands {stands:.4g} mm away; take a longer span (free_length) "
            "or fewer layers"
        )

    def _lying(self) -> float:
        """Return the energy [J] in the springs between the integrated nodes and cable below."""
        nodes = self._nodes
        if not nodes.below.size:
            return 0.0
        return lying_energy(nodes.points, self._constants.touch, nodes.live)

    def _find_below(self, lying: float) -> None:
        """Look up which cable the integrated nodes may lie on, at an energy on that so far [J]."""
        nodes, k, wound = self._nodes, self._constants, self._wound
        begin = float(nodes.resting.row(resting_cable.THETA)[-1])
        path = unrolled(begin, nodes.position)
        laid, turn = nodes.laid(), TURN - AHEAD * k.touch.apart / k.contact_line
        farthest, low = reach(path, laid, 2.0 * k.touch.apart)
        if farthest < turn:
            nodes.way = (turn - farthest) * k.contact_line
            return
        # Laid cable is lain on though it is still integrated.
        over = low - begin > turn
        if over:
            wound.lay(self._lines(path[:, :laid]), rests=False)
        # As `touch_wound` sees them: chords join the nodes, and springs carry them.
        sunk = 2.0 * self._drive[LANDING] - k.start_radius - k.contact_line
        free = nodes.touching[: nodes.live] == 0
        found = wound.below(path, sunk * k.contact_line / path[2], free)
        if over:
            wound.lift(begin)
        nodes.look(found, float(self._drive[LANDING]))
        self._share, now = self._bare, 0.0
        if nodes.below.size:
            now, stiffest, fastest = springs(nodes.points, k.touch, nodes.live, self._surface_rate)
            self._share = self._step_share(stiffest, fastest)
        # Cable that turns up below is a surface that moves.
        self._ledger[WORK_SURFACE] += now - lying

    def _step_share(self, stiffest: float, fastest: float) -> float:
        """Return the share of the bare cylinder's step that is stable and right on cable below.

        Args:
            stiffest: Stiffness that contact has at most [N/m].
            fastest: Speed of what falls [m/s].
        """
        mass, touch = self._constants.mass, self._constants.touch
        bare = mass * (2.0 * STEP_SAFETY / self.step_limit) ** 2 - touch.normal_stiffness
        stable = stable_step(mass, bare, stiffest, touch) / self.step_limit
        falls = FALL * touch.apart / max(fastest * self.step_limit, FALL * touch.apart)
        if falls < 1.0:
            self._restless = self.time + AWAKE_FOR
        most = RESTLESS if self.time < self._restless else 1.0
        return min(most, stable, max(falls, SHORTEST))

    def _lay(self, nodes: int) -> None:
        """Add the last resting nodes to the wound surface."""
        rows = self._nodes.resting
        since = slice(rows.count - 1 - nodes, rows.count)
        (x, y, z), theta = rows.place()[:, since], rows.row(resting_cable.THETA)[since]
        self._wound.lay(self._lines(np.stack([theta, z, np.hypot(x, y)])))

    def _lines(self, path: FloatArray) -> FloatArray:
        """Return a path (3, n) of nodes, which chords join, with the radii of its centre line."""
        line, chords = self._constants.contact_line, self._constants.start_radius
        return np.stack([path[0], path[1], path[2] - (chords - line) * line / path[2]])

    def _look(self, t: float, angle: float, awake: int, fewest: int) -> None:
        """Lay to rest what has not moved over the cylinder since the look before.

        Args:
            t: Time [s].
            angle: Of the cylinder [rad].
            awake: Laid nodes that do not rest.
            fewest: Nodes that are worth being moved.
        """
        nodes = self._nodes
        candidates = max(1, nodes.laid() - awake)
        # Between cable that it lies on, cable may bridge a gap.
        off = np.flatnonzero((nodes.touching[1:candidates] == 0) & (not nodes.below.size))
        held = 1 + int(off[0]) if off.size else candidates
        still = self._stillness.look(t, nodes.place(held, angle), nodes.below.size > 0)
        resting = still - 1 - WATCHED
        if resting >= fewest:
            before = self._kinetic(nodes.points, resting + 1)
            self._ledger[LOSS_RELAXATION] += nodes.resting.fade(t)
            lying = self._lying()
            nodes.rest(resting, angle)
            self._lay(resting)
            if nodes.below.size:
                self._find_below(lying)
            self._ledger[WORK_TIE] -= before
            self._stillness.begin_anew()

    def _wake(self, t: float, now: float, angle: float) -> None:
        """Integrate the last nodes again that were laid to rest, as they are now."""
        nodes = self._nodes
        woken = min(WOKEN, nodes.resting.count - 1)
        back = self._surface_rate * self._last_step
        self._ledger[LOSS_RELAXATION] += nodes.resting.fade(now)
        nodes.wake(woken, angle, back, self._last_step)
        self._ledger[WORK_TIE] += self._kinetic(nodes.points, woken + 1)
        self._wound.lift(float(nodes.resting.row(resting_cable.THETA)[-1]))
        self._stillness.woken(t)

    def _records(self, begin: int) -> NDArray[np.void]:
        """Return the nodes from a resting one on as records of NODE_DTYPE."""
        resting = self._nodes.resting
        # A node more than is wanted: its element is the one towards P0.
        start = max(begin - 1, 0)
        records = np.zeros(self.nodes - start, dtype=NODE_DTYPE)
        first = resting.count - 1 - start
        x, y, z = resting.place()[:, start:]
        records["x"][: first + 1], records["y"][: first + 1] = turned(self.cylinder_angle, x, y)
        records["z"][: first + 1] = z
        for name, values in zip("xyz", self._nodes.position, strict=True):
            records[name][first:] = values
        records["s"] = self._nodes.path()[0][start:]
        stretch = self._stretch_from(start)
        tension = self._tension_from(start, stretch)
        records["strain"][1:] = stretch - 1.0
        records["tension"][1:] = tension
        records["strain"][0], records["tension"][0] = stretch[0] - 1.0, tension[0]
        records["roll"] = self._nodes.roll(start)
        self._fill_twist(records, self._laid_nodes() - start)
        return records[begin - start :]

    def _stretch_from(self, node: int) -> FloatArray:
        """Return the stretch of the elements from a resting node on."""
        return np.concatenate([self._nodes.resting.stretch(node), self._nodes.live_stretch()])

    def _tension_from(self, node: int, stretch: FloatArray) -> FloatArray:
        """Return the tension [N] of the elements from a resting node on, at their stretch."""
        area, law = self.config.case.axial_area, self.config.resolved.law
        tension = np.asarray(area * law.nominal_stress(stretch))
        if self._relaxes:
            nodes = self._nodes
            live = nodes.viscous[1:, : nodes.live - 1].sum(axis=0)
            tension -= np.concatenate([nodes.resting.faded(self.time, node), live])
        tension[-1] = self._drive[TENSION]
        return tension

    def _response(self, tension: float) -> tuple[float, float]:
        """Return (stretch of the span, radius at which its nodes land [m]) at a tension [N]."""
        return self.config.resolved.response_at(tension)

    def _whole(self) -> WholeRod:
        back = self._surface_rate * self._last_step
        return self._nodes.whole(self.cylinder_angle, back, self._last_step)

    def _stored(self, whole: WholeRod) -> float:
        return whole.stored(self.config.resolved)

    def _kinetic(self, cable: Points, end: int) -> float:
        return kinetic_energy(cable, self.config.resolved, end)

    def _raised(self, nodes: int) -> FloatArray | None:
        """Return how high the first nodes lie above a first layer [m]; None without a drum."""
        if self.config.drum is None:
            return None
        both = [self._nodes.resting.place(), self._nodes.position[:, 1:]]
        x, y, _ = np.concatenate(both, axis=1)[:, :nodes]
        return np.asarray(np.maximum(np.hypot(x, y) - self.config.case.centreline_radius, 0.0))

    def _laid_nodes(self) -> int:
        return self._nodes.resting.count - 1 + self._nodes.laid()
