"""Processor time that winding a run will take, estimated before it begins."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.validity import (
    FULL_TURN,
    OVERLAP,
    landing_share,
    motion_share,
    wave_share,
)

# Steps of a first call, which loads machine code and fills tables and is not timed; the next ones
# are longer each, until one has taken so much processor time [s] that what a call costs beside its
# steps does not count.
_TRIAL_STEPS, _LONGER, _TRIAL_S = 50, 2, 0.03
# Where cable lies on cable a step is shorter and pushes both ways, of fewer elements; beside it is
# a look [s] for each way in distances of touching centre lines.
_ON_CABLE, _LOOK_S, _LOOK_WAY = 1.2, 1.0e-4, 0.1
# Nodes of the rod that lie on the cylinder and are integrated although they do not move.
_AWAKE_NODES = 32
_REST_S = 0.2  # Cable comes to rest this long after it has landed [s]
# What a call of the model costs beside its steps [s], and a step beside its elements, in elements:
# spans of 10 to 30 elements cost 1.1 to 1.5 times as much for each as the 30 to 60 of a run.
_CALL_S, _STEP = 4.0e-4, 4.0
# Nine cables of the kinds of `_QUASI_STATIC` in `winding/validity.py`, their density raised step by
# step, change their wound tension by less than 0.4 % while motion takes at most this share of it
_SLOW = 0.02
# and landings change it by the share _RINGING at most, however the span rings with them. It rings
# where they follow each other at a rate of its axial waves, first at a quarter of a period; up to
# half of that the share _CALM changes it by 0.25 %.
_RINGING, _CALM, _CALM_WAVE = 3.0e-4, 1.0e-3, 0.125
# The lay changes by less than pitch L / rho times either root of motion over tension or strain
# energy times these; it may change by a share of the cable's diameter.
_LAG_TENSION, _LAG_STRAIN, _LAY = 0.08, 0.004, 0.01
_LARGEST = 1.0e4  # As much as the parameter allows
# A live run has a core for everything; half of it is sure to suffice when an estimate may be wrong
# by a factor of two. Elements times steps per simulated second that take less anywhere.
_LIVE, _SURELY_LIVE = 0.5, 2.0e6


@dataclass(frozen=True, kw_only=True)
class ExpectedCost:
    """What a run will take."""

    cpu_seconds: float  # Processor time [s] on this computer, as it is loaded now
    steps: int  # Steps of integration
    elements: float  # That are integrated, mean over the run
    # Largest factor on the density with which the cable still lies as if it were wound slowly.
    mass_scaling: float
    scaled_cpu_seconds: float  # Processor time with that factor [s]


def expected_cost(
    run: PlannedRun, cpu_clock: Callable[[], float], *, rate: float = 50.0
) -> ExpectedCost:
    """Return what a run will take, from winding its first steps.

    Args:
        run: The run.
        cpu_clock: Processor time [s].
        rate: Calls of the model per simulated second [1/s].

    Raises:
        DivergenceError: The integration fails within the first steps.
    """
    model = run.model()
    trial, t, taken, counted = _TRIAL_STEPS * model.step_limit, 0.0, 0.0, 1.0
    while t == 0.0 or (taken < _TRIAL_S and t < run.duration):
        last, before, began = t, model.element_steps, cpu_clock()
        t = min(t + trial, run.duration)
        model.advance_to(t, run.drive.reading_at(t))
        if last > 0.0:
            taken = cpu_clock() - began
            counted = model.element_steps - before + _STEP * (t - last) / model.step_limit
            trial *= _LONGER
    steps = math.ceil(run.duration / min(model.step_limit, 1.0 / rate))
    elements = model.element_steps * model.step_limit / t
    if run.element == "rod":
        elements = _rod_elements(run)
    calls = _CALL_S * rate * run.duration
    stepping = taken / counted * steps * (elements + _STEP)
    way = _way_on_cable(run)
    if way > 0.0:
        looks = way / (_LOOK_WAY * run.config.resolved.constants.touch.apart)
        stepping *= 1.0 + _ON_CABLE * way / (run.config.resolved.wound_radius * run.most_wound)
        calls += _LOOK_S * looks
    scaling = _largest_scaling(run)
    return ExpectedCost(
        cpu_seconds=stepping + calls,
        steps=steps,
        elements=elements,
        mass_scaling=scaling,
        scaled_cpu_seconds=stepping / math.sqrt(scaling / run.config.mass_scaling) + calls,
    )


def falling_behind(run: PlannedRun, cpu_clock: Callable[[], float], *, pace: float = 1.0) -> str:
    """Return by how much a live run cannot keep up and what to do about it; empty where it can.

    Args:
        run: What is wound live, with the rod.
        cpu_clock: Processor time [s].
        pace: Simulated seconds per second.

    Raises:
        DivergenceError: The integration fails within the first steps.
    """
    resolved = run.config.resolved
    if pace * _rod_elements(run) / resolved.step < _SURELY_LIVE:
        return ""
    cost = expected_cost(run, cpu_clock)
    needed, scaled = (
        pace * seconds / run.duration for seconds in (cost.cpu_seconds, cost.scaled_cpu_seconds)
    )
    if needed < _LIVE:
        return ""
    sentence = (
        f"the solver needs about {needed:.2g} s of processor time a second (limit {_LIVE:g}) and "
        "may fall behind the machine: "
    )
    more = cost.mass_scaling / run.config.mass_scaling
    if more > 1.0:
        motion = more * motion_share(resolved, run.drive)
        kinetic = (wave_share(resolved, run.drive.angular_speed) / (resolved.stretch - 1.0)) ** 2
        sentence += (
            f"a mass scaling of {cost.mass_scaling:g} (mass_scaling) takes about {scaled:.2g} s "
            "and changes the wound tension by less than 0.4 %, the lay by about 1 % of the "
            f"cable's diameter; motion then takes rho A v max(v, L / t) / F = {motion:.2g} of "
            f"the tension, kinetic over strain energy is {more * kinetic:.2g}"
        )
        if scaled < _LIVE:
            return sentence
        sentence += "; still too much: "
    return f"{sentence}wind slower, or take longer elements (segment_length)"


def _way_on_cable(run: PlannedRun) -> float:
    """Return over which way [m] cable lands beside or on cable, as far as that is known before."""
    over = run.config.drum is not None or (
        run.checks()[-1].name == OVERLAP and run.checks()[-1].warned
    )
    beyond = run.most_wound - FULL_TURN
    return run.config.resolved.wound_radius * beyond if over and beyond > 0.0 else 0.0


def _rod_elements(run: PlannedRun) -> float:
    """Return the mean number of the rod's elements that do not rest."""
    resolved = run.config.resolved
    length = resolved.segment * resolved.stretch
    t = np.linspace(0.0, run.duration, 400)
    angle, speed = run.drive.positions(t)[0], np.abs(run.drive.speeds(t)[0])
    laid = resolved.wound_radius * angle / length
    if run.config.rests:
        landing = resolved.wound_radius * speed / length
        laid = np.minimum(laid, _AWAKE_NODES + _REST_S * landing)
    return float(run.config.free_length / length + laid.mean())


def _largest_scaling(run: PlannedRun) -> float:
    """Return the factor on the density that `ExpectedCost` proposes, to one digit."""
    now, resolved, drive = run.config.mass_scaling, run.config.resolved, run.drive
    length = run.config.free_length
    landing, wave = (part(resolved, drive.angular_speed) for part in (landing_share, wave_share))
    strain = resolved.stretch - 1.0
    lag = min(_LAG_TENSION * wave / math.sqrt(strain), _LAG_STRAIN * wave / strain)
    lay = abs(drive.pitch) * length / resolved.wound_radius * lag
    first = _CALM_WAVE * resolved.segment * resolved.stretch / length
    quick = min(
        max(min(_CALM / landing, first / wave), _RINGING / landing),
        _LAY * run.config.case.cable_diameter / max(lay, 1.0e-300),
    )
    largest = min(now * min(quick**2, _SLOW / motion_share(resolved, drive)), _LARGEST)
    if largest <= now:
        return now
    digit = 10.0 ** math.floor(math.log10(largest))
    return math.floor(largest / digit) * digit
