"""Whether laid cable lies still, so that it may rest."""

import numpy as np

from cable_fem_node.dynamics.state import FloatArray

LOOK_PERIOD = 0.1  # Time between two looks [s]. Oscillations of the span decay within it.
AWAKE_FOR = 0.5  # Time for which nodes that had to be woken are left alone [s]


class Stillness:
    """Compares where nodes are on the cylinder with where they were.

    What oscillates about its place is still by this measure, what creeps is not.

    Args:
        tolerance: Motion between two looks of a node that counts as still [m].
        on_cable: The same where cable lies on cable [m].
    """

    def __init__(self, tolerance: float, on_cable: float) -> None:
        self._tolerance, self._on_cable = tolerance, on_cable
        self._seen = np.zeros((3, 0))
        self._next = 0.0

    def due(self, t: float) -> bool:
        """Return whether a look is due at a time [s]."""
        return t >= self._next

    def begin_anew(self) -> None:
        """Forget the look before: the nodes have other numbers from now on."""
        self._seen = np.zeros((3, 0))

    def woken(self, t: float) -> None:
        """Begin anew a while after a time [s] at which resting nodes had to be woken."""
        self.begin_anew()
        self._next = t + AWAKE_FOR

    def look(self, t: float, place: FloatArray, lies: bool) -> int:
        """Return how many nodes, from the first on, are where they were at the look before.

        Args:
            t: Time [s].
            place: Of the nodes in the frame of the cylinder [m], shape (3, n).
            lies: Whether cable lies on cable.
        """
        tolerance = self._on_cable if lies else self._tolerance
        both = min(place.shape[1], self._seen.shape[1])
        moved = ((place[:, :both] - self._seen[:, :both]) ** 2).sum(axis=0)
        self._seen = place
        self._next = t + LOOK_PERIOD
        restless = np.flatnonzero(~(moved <= tolerance**2))
        return int(restless[0]) if restless.size else both
