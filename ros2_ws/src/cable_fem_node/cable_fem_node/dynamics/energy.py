"""Energy ledger: where the work that enters a model goes."""

from __future__ import annotations

from dataclasses import dataclass


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
    """

    kinetic: float
    internal: float
    contact: float
    external: float
    friction: float
    damping: float
    initial: float = 0.0

    @property
    def residual(self) -> float:
        """Energy that the ledger cannot explain [J]."""
        present = self.kinetic + self.internal + self.contact
        return present + self.friction + self.damping - self.external - self.initial

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
            )
        )
        return 100.0 * abs(self.residual) / greatest if greatest > 0.0 else 0.0

    @property
    def kinetic_over_internal(self) -> float:
        """Kinetic over internal energy; small in a quasi-static run."""
        return self.kinetic / self.internal if self.internal > 0.0 else 0.0
