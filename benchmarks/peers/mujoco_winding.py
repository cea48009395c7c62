"""The winding in MuJoCo 4: a one-dimensional flex (bending and twist) on a turning capsule.

MuJoCo's flex rod does not stretch by itself. Three ways to give it axial stiffness:

- ``inextensible``: equality constraints on the edges, the replacement of MuJoCo's cable that its
  documentation names; the stretch is an artefact of soft constraints.
- ``edge``: springs EA / h on the edges, explicit, with a step near the Courant limit.
- ``tendon``: a tendon's spring EA / h over each edge, implicit.

Contact impedances are far stiffer than MuJoCo's defaults, with which the cable sinks in by a
third of its radius and creeps off its helix.
"""

from __future__ import annotations

import math
import time

import mujoco
import numpy as np
from winding_problem import Outcome, WindingProblem, marks_of_nodes

# 80 us at 5 mm (100 us diverges) for explicit springs; the others are implicit.
EXPLICIT_STEP_PER_SEGMENT = 0.016
IMPLICIT_STEP = 5.0e-4

# Time constant of the springs' own damping [s].
SPRING_DAMPING = 2.0e-5

# Radius of the guide's four capsules, and the play of the cable between them [m].
BAR = 4.0e-3
PLAY = 2.0e-4

INERTIA_OF_THE_DRIVEN = 1.0e3
LOOK_EVERY = 500


def _model_text(problem: WindingProblem, mode: str, dt: float, arc: np.ndarray) -> str:
    case = problem.case
    spring = problem.axial_stiffness / problem.segment_length
    explicit = mode == "edge"
    edge = {
        "edge": f'<edge stiffness="{spring}" damping="{spring * SPRING_DAMPING}"/>',
        "tendon": "",
        "inextensible": f'<edge equality="true" solref="{2 * dt} 1" solimp="0.9999 0.9999 1e-4"/>',
    }[mode]
    stiff = f'solref="{max(2 * dt, 2e-4)} 1" solimp="0.999 0.999 1e-4"'
    away = BAR + case.cable_radius + PLAY
    bars = "\n".join(
        f'<geom type="capsule" size="{BAR}" fromto="{begin} {end}" mass="0.1" condim="1" '
        f'contype="1" conaffinity="2" solref="{max(2 * dt, 2e-4)} 1"/>'
        for begin, end in (
            (f"{away} 0 -0.02", f"{away} 0 0.02"),
            (f"{-away} 0 -0.02", f"{-away} 0 0.02"),
            (f"-0.02 0 {away}", f"0.02 0 {away}"),
            (f"-0.02 0 {-away}", f"0.02 0 {-away}"),
        )
    )
    points = " ".join(f"0 {-s} 0" for s in arc)
    edges = " ".join(f"{i} {i + 1}" for i in range(arc.size - 1))
    mass = problem.segment_mass * (arc.size - 1)
    return f"""
<mujoco>
 <option timestep="{dt}" gravity="0 0 0" integrator="{"Euler" if explicit else "discrete"}"
  cone="elliptic" solver="Newton" tolerance="1e-8" impratio="100"/>
 <size memory="200M"/>
 <worldbody>
  <body name="cylinder">
   <joint name="cylinder" type="hinge" axis="0 0 1" armature="{INERTIA_OF_THE_DRIVEN}"/>
   <geom type="capsule" size="{case.cylinder_radius} 0.25" mass="0.5" condim="3"
    friction="{problem.friction} 0 0" contype="1" conaffinity="2" {stiff}/>
  </body>
  <body name="guide" pos="{problem.radius} {-problem.free_length} 0">
   <joint name="guide" type="slide" axis="0 0 1" armature="{INERTIA_OF_THE_DRIVEN}"/>
   {bars}
  </body>
  <flexcomp name="C" type="direct" dim="1" pos="{problem.radius} 0 0" point="{points}"
   element="{edges}" radius="{case.cable_radius}" mass="{mass}">
   {edge}
   <elasticity young="{case.material.young}" poisson="{case.material.poisson}"
    damping="{SPRING_DAMPING if explicit else 2e-3}"/>
   <contact selfcollide="none" condim="3" friction="{problem.friction} 0 0"
    contype="2" conaffinity="1" {stiff}/>
  </flexcomp>
 </worldbody>
</mujoco>"""


def _compiled(problem: WindingProblem, mode: str, dt: float, arc: np.ndarray) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(_model_text(problem, mode, dt, arc))
    if mode == "tendon":
        h = problem.segment_length
        spring = problem.axial_stiffness / h
        for i in range(arc.size):
            spec.body(f"C_{i}").add_site(name=f"S{i}", pos=[0.0, 0.0, 0.0])
        for i in range(arc.size - 1):
            tendon = spec.add_tendon(
                name=f"T{i}",
                stiffness=spring,
                damping=spring * SPRING_DAMPING,
                springlength=[h, h],
            )
            tendon.wrap_site(f"S{i}")
            tendon.wrap_site(f"S{i + 1}")
    return spec.compile()


def wind(problem: WindingProblem, *, mode: str) -> Outcome:
    """Wind with one of the three ways to stretch a flex: inextensible, edge, tendon.

    The first two nodes are moved with the cylinder: together they clamp P0 along its tangent.
    """
    dt = EXPLICIT_STEP_PER_SEGMENT * problem.segment_length if mode == "edge" else IMPLICIT_STEP
    stretch = 1.0 if mode == "inextensible" else problem.stretch
    arc = problem.stations(stretch)
    model = _compiled(problem, mode, dt, arc)
    bodies = np.array([model.body(f"C_{i}").id for i in range(arc.size)])
    model.body_mass[bodies[:2]] = 1.0
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    joints = model.body_jntadr[bodies]
    at = model.jnt_qposadr[joints][:, None] + np.arange(3)
    moves = model.jnt_dofadr[joints][:, None] + np.arange(3)
    rest = np.column_stack([np.full(arc.size, problem.radius), -arc, np.zeros(arc.size)])
    begin = rest * (1.0, stretch, 1.0)
    data.qpos[at] = begin - rest
    model.dof_damping[moves.ravel()] = problem.damping_rate * problem.segment_mass
    data.xfrc_applied[bodies[-1], 1] = -problem.case.weight
    cylinder, guide = model.joint("cylinder"), model.joint("guide")
    bad = mujoco.mjtWarning.mjWARN_BADQACC
    steps = round(problem.duration / dt)
    started = time.process_time()
    for step in range(steps):
        angle, height = problem.drive.positions(step * dt)
        rate, feed = problem.drive.speeds(step * dt)
        c, s = math.cos(angle), math.sin(angle)
        held = begin[:2] @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        data.qpos[cylinder.qposadr[0]], data.qvel[cylinder.dofadr[0]] = angle, rate
        data.qpos[guide.qposadr[0]], data.qvel[guide.dofadr[0]] = height, feed
        data.qpos[at[:2]] = held - rest[:2]
        data.qvel[moves[:2]] = np.column_stack([-rate * held[:, 1], rate * held[:, 0], [0.0, 0.0]])
        mujoco.mj_step(model, data)
        # MuJoCo resets a diverged state and goes on; the warning is the only trace.
        if step % LOOK_EVERY == 0 and data.warning[bad].number:
            break
    used = time.process_time() - started
    reached = (step + 1) * dt
    mujoco.mj_kinematics(model, data)
    place = data.xpos[bodies].copy()
    return Outcome(
        solver=f"MuJoCo, {mode}",
        version=mujoco.__version__,
        step=dt,
        elements=arc.size - 1,
        cpu_seconds=used,
        duration=reached,
        diverged=bool(data.warning[bad].number) or not np.isfinite(place).all(),
        stretch=stretch,
        wound_radius=problem.radius,
        marks=marks_of_nodes(place, arc, problem, reached),
    )
