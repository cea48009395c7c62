"""Energy ledger: where the work that enters a model goes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.points import (
    LOSS_CONTACT,
    LOSS_DAMPING,
    LOSS_FRICTION,
    LOSS_RELAXATION,
    WORK_INFLOW,
    WORK_SPAN,
    WORK_SURFACE,
    WORK_TIE,
)


@dataclass(frozen=True, kw_only=True)
class EnergyLedger:
    """Energies since the start of a run [J].

    Attributes:
        kinetic: Energy of motion.
        internal: Strain energy, stretching and bending.
        contact: Stored in the penalty springs, normal and stick.
        external: Work done on the model: drum, guide, span tension, energy of fed cable.
        friction: Turned to heat by sliding.
        damping: Taken by mass-proportional damping, contact dashpots, viscosity.
        initial: Energy stored at the start.
        relaxation: Turned to heat in the cable, whose stress fades.
    """

    kinetic: float
    internal: float
    contact: float
    external: float
    friction: float
    damping: float
    initial: float = 0.0
    relaxation: float = 0.0

    @classmethod
    def of(
        cls,
        entries: NDArray[np.float64],
        *,
        kinetic: float,
        internal: float,
        contact: float,
        initial: float,
    ) -> EnergyLedger:
        """Return the ledger of what is stored and of a kernel's entries, shape (LEDGER_SIZE,)."""
        work = entries[WORK_TIE] + entries[WORK_SURFACE] + entries[WORK_SPAN] + entries[WORK_INFLOW]
        return cls(
            kinetic=kinetic,
            internal=internal,
            contact=contact,
            external=float(work),
            friction=float(entries[LOSS_FRICTION]),
            damping=float(entries[LOSS_CONTACT] + entries[LOSS_DAMPING]),
            initial=initial,
            relaxation=float(entries[LOSS_RELAXATION]),
        )

    @property
    def residual(self) -> float:
        """Energy that the ledger cannot explain [J]."""
        present = self.kinetic + self.internal + self.contact
        heat = self.friction + self.damping + self.relaxation
        return present + heat - self.external - self.initial

    @property
    def balance_pct(self) -> float:
        """Residual in percent of the greatest energy in the ledger."""
        greatest = max(
            abs(value)
            for value in (
                self.kinetic,
                self.internal,
                self.external,
                self.friction,
                self.damping,
                self.initial,
                self.relaxation,
            )
        )
        return 100.0 * abs(self.residual) / greatest if greatest > 0.0 else 0.0

    @property
    def kinetic_over_internal(self) -> float:
        """Kinetic over internal energy; small in a quasi-static run."""
        return self.kinetic / self.internal if self.internal > 0.0 else 0.0
