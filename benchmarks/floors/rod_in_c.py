"""The rod's step in C, compiled for this processor and called with the solver's own state."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cable_fem_node.rod.rod_kernels import SERIES_LIMIT, empty_work
from cable_fem_node.rod.rod_records import CUT_AT, MERGE_AT, RUNNING
from floors.rod_state import FloatArray, RodState

SOURCE = Path(__file__).with_name("rod_step.c")
OPTIONS = ("-O3", "-march=native")
# What the kernel allows its compiler, too (`cable_fem_node.dynamics.compile`).
REORDERED = (
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fassociative-math",
    "-freciprocal-math",
)

Advance = Callable[[RodState, FloatArray, int, float], None]


class _Constants(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            *("segment", "mass", "bending", "damping_rate", "start_radius", "contact_line"),
            *("free_length", "normal_stiffness", "normal_damping", "stick_stiffness"),
            *("stick_damping", "friction", "table_low", "per_spacing", "area", "series_limit"),
            *("cut_at", "merge_at"),
        )
    ]


class _Arrays(ctypes.Structure):
    _fields_ = [
        *(
            (name, ctypes.c_void_p)
            for name in (
                *("position", "velocity", "slip", "contact_radius", "reference", "touching"),
                *("tangent", "inverse", "tension", "cosine", "slope", "force", "net"),
                *("along", "table"),
            )
        ),
        ("table_rows", ctypes.c_int64),
        ("capacity", ctypes.c_int64),
    ]


class _State(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int64) for name in ("nodes", "taken", "status")),
        ("surface_step", ctypes.c_double),
    ]


def compiler() -> str | None:
    """Return a C compiler of this machine, if there is one."""
    return next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)


def compiled(compiler: str, folder: Path, further: tuple[str, ...] = ()) -> Advance:
    """Return the step in C.

    Args:
        compiler: Command.
        folder: Where its library is put.
        further: Options beside `OPTIONS`.
    """
    library = folder / f"rod_step{len(further)}.so"
    subprocess.run(
        [compiler, *OPTIONS, *further, "-shared", "-fPIC", "-o", library, SOURCE, "-lm"], check=True
    )
    function = ctypes.CDLL(str(library)).advance

    def advance(state: RodState, drive: FloatArray, steps: int, dt: float) -> None:
        drive = np.ascontiguousarray(drive)
        k, response = state.constants, state.response
        constants = _Constants(
            *(k.segment, k.mass, k.bending, k.damping_rate, k.start_radius, k.contact_line),
            *(k.free_length, *k.touch[:5], response.low, response.per_spacing, response.area),
            *(SERIES_LIMIT, CUT_AT, MERGE_AT),
        )
        cable, work = state.cable, empty_work(state.reference.size)
        table = np.ascontiguousarray(response.table)
        arrays = _Arrays(
            *(
                array.ctypes.data
                for array in (
                    *(cable.position, cable.velocity, cable.slip, cable.contact_radius),
                    *(state.reference, cable.touching, *work[:8], table),
                )
            ),
            table.shape[0],
            state.reference.size,
        )
        moving = _State(nodes=state.nodes, surface_step=state.surface_step)
        function(
            ctypes.byref(moving),
            ctypes.c_int64(steps),
            ctypes.c_double(dt),
            ctypes.c_void_p(drive.ctypes.data),
            ctypes.byref(arrays),
            ctypes.byref(constants),
            ctypes.c_void_p(state.ledger.ctypes.data),
        )
        assert (moving.taken, moving.status) == (steps, RUNNING)
        state.nodes, state.surface_step = moving.nodes, moving.surface_step

    return advance
