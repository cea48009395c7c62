"""What of the guide's readings can be believed: their zero is unknown, their scale may be wrong."""

from __future__ import annotations

import math

# Rotation [rad] after which the guide's travel tells its scale; the commanded feed serves before.
JUDGED_AFTER = 0.3
# Travel over commanded travel within which a machine may well have another feed than was said.
LEAST_SCALE, MOST_SCALE = 0.2, 5.0
# Of the height in the pictures over the height that the guide promises: a wrong free length does
# not reach so far.
LEAST_HEIGHT, MOST_HEIGHT = 0.7, 1.4
# Readings in millimetres are a thousand times those in metres, with another feed beside that.
LEAST_MILLIMETRES, MOST_MILLIMETRES = 300.0, 3000.0


class GuideReadings:
    """The guide's way since P0 landed, from readings whose zero is anywhere.

    Args:
        advance_per_radian: Commanded feed [m/rad].
    """

    def __init__(self, advance_per_radian: float) -> None:
        self._feed = advance_per_radian
        self._zero = math.nan
        self._first = math.nan
        self._scale = math.nan

    @property
    def scale(self) -> float:
        """Travel over commanded travel; nan before that is known."""
        return self._scale

    @property
    def believed(self) -> bool:
        """Whether the path is laid by the readings and not by the commanded feed."""
        return LEAST_SCALE <= self._scale <= MOST_SCALE

    def since_p0(self, angle: float, guide: float) -> float:
        """Return the guide's way since P0 landed [m]; nan to expect the commanded feed.

        Args:
            angle: Cylinder angle [rad]; nan while the encoder is out.
            guide: Reading [m]; nan for none.
        """
        if not (math.isfinite(angle) and math.isfinite(guide)):
            return math.nan
        if math.isnan(self._zero):
            self._zero, self._first = guide, angle
        turned, travel = angle - self._first, guide - self._zero
        if math.isnan(self._scale) and abs(turned) >= JUDGED_AFTER:
            self._scale = travel / (self._feed * turned) if self._feed else math.nan
        if not self.believed:
            return math.nan
        # P0 may have landed before the first reading: the feed was the same then.
        return travel + self._feed * self._scale * self._first

    def contradiction(self, height_ratio: float) -> str:
        """Return what is wrong with the readings, empty if nothing.

        Args:
            height_ratio: Of the markers' heights over those of the path, dimensionless; nan
                while none is known.
        """
        if math.isnan(self._scale):
            return ""
        if self.believed:
            if math.isnan(height_ratio) or LEAST_HEIGHT <= height_ratio <= MOST_HEIGHT:
                return ""
            return (
                f"the guide's readings contradict the pictures: the cable lies {height_ratio:.2f} "
                "times as far along the cylinder as they say"
            )
        if LEAST_MILLIMETRES <= self._scale <= MOST_MILLIMETRES:
            why = "are they millimetres instead of metres?"
        elif self._scale < 0.0:
            why = "is their sign reversed?"
        else:
            why = "is their scale right?"
        return (
            f"the guide's readings move {self._scale:.3g} times as far as the commanded feed, "
            f"{why} The commanded feed is used instead"
        )
