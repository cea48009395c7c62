"""Runs in the format of DEFORM, made with this rod: nothing of that data set is kept."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from winding_verification.experiments.held_cable import HeldCable, predict

CABLE = HeldCable(bending=0.05, viscosity=0.1, drag=0.0, natural=(0.0, 0.0), own=0.0)
GAPS = np.array([0.02, 0.08, 0.08, 0.08, 0.08, 0.08, 0.02])


def hanging(cable: HeldCable = CABLE, frames: int = 150) -> FloatArray:
    """Return markers (8, 3) [m] of a cable that has come to rest between clamps, ends downwards."""
    arc = np.concatenate([[0.0], np.cumsum(GAPS)]) - 0.5 * GAPS.sum()
    turned = np.pi * arc / GAPS.sum()
    radius = GAPS.sum() / np.pi
    arch = radius * np.stack([np.sin(turned), np.zeros(8), -np.cos(turned)], axis=1)
    return predict(np.tile(arch, (frames, 1, 1)), GAPS, cable)[-1]


def moved_run(rest: FloatArray, frames: int, swing: float, cable: HeldCable = CABLE) -> FloatArray:
    """Return a run (frames, 8, 3): both ends sway across the cable by a swing [m]."""
    way = swing * np.sin(0.06 * np.arange(frames)) ** 2
    run = np.tile(rest, (frames, 1, 1))
    run[:, :, 1] += way[:, None]
    run[:, -2:, 0] += 0.5 * way[:, None]
    run[:2] = rest
    return predict(run, GAPS, cable)


def write_run(file: Path, run: FloatArray) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(pickle.dumps(np.swapaxes(run, 1, 2).tolist(), protocol=4))


def write_losses(folder: Path, name: str, losses: list[float]) -> None:
    """Write what training recorded, as numpy's scalars, as the data set has it."""
    file = folder / "loss_record" / f"eval_loss_{name}.pkl"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(pickle.dumps([np.float64(loss) for loss in losses], protocol=4))
