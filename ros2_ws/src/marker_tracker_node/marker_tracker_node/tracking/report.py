"""What a tracker reports about itself, for diagnostics."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from marker_tracker_node.tracking.estimator.contradictions import Contradiction

# Single frames that come twice or late spoil nothing: share of frames that may be refused.
_MOST_REFUSED = 0.01


class FrameFault(Enum):
    """Why a frame was not used."""

    EMPTY = "empty frame"
    WRONG_SIZE = "frame of another size than the camera's"
    WRONG_ENCODING = "frame that is not 8-bit blue-green-red"
    OUT_OF_ORDER = "frame older than the last"
    DUPLICATE = "frame with the stamp of the last"
    OTHER_CLOCK = "frame of a camera whose clock is too far from the encoder's"
    NOT_A_TIME = "frame without a finite time"


@dataclass(frozen=True, kw_only=True)
class TrackerReport:
    """Counts since the start and the situation in the last frame.

    Attributes:
        colour_separation: Share of background pixels that the colour model rejects; nan if
            unknown.
    """

    frames: int  # Frames used
    rejected: dict[FrameFault, int]  # Frames refused, by reason
    known: int  # Markers that are known, P0 among them
    measured: int  # Markers measured in the last frame
    slipped: tuple[int, ...]  # Numbers of the markers that have slipped
    encoder_lost: bool  # Whether the last frame came without an encoder reading
    encoder_losses: int  # Times that the encoder went missing
    encoder_wraps: int  # Turns that the encoder lost by wrapping
    colour_refusal: str  # Why no colour could be learnt yet; empty when there is one
    remarks: tuple[str, ...]  # What was found at the start against expectation
    colour_separation: float
    contradictions: tuple[Contradiction, ...]  # Configured numbers that the pictures speak against
    missing: tuple[int, ...] = ()  # Numbers of the markers that should have been found long ago
    guide_doubt: str = ""  # What is wrong with the guide's readings; empty if nothing
    clock_doubt: str = ""  # What is wrong with the camera's clock; empty if nothing
    judged: bool = True  # Whether the sightings of two markers have been explained

    @property
    def doubts(self) -> tuple[str, ...]:
        """What contradicts the run that is expected, in sentences."""
        refused = sum(self.rejected.values())
        doubts = (
            self.guide_doubt,
            *(f"P{n} was not found where it should lie" for n in self.missing),
            *(f"P{n} has slipped" for n in self.slipped),
            "the encoder is silent" if self.encoder_lost else "",
            f"{refused} of {refused + self.frames} frames were refused"
            if refused > _MOST_REFUSED * self.frames
            else "",
        )
        return tuple(filter(None, doubts))

    @property
    def healthy(self) -> bool:
        """Whether nothing is wrong at the moment."""
        wrong = [item for item in self.contradictions if not item.doubted]
        against = (self.colour_refusal, self.clock_doubt, wrong, self.doubts)
        # Nothing rests on what is configured while P0 alone is known.
        return not any(against) and self.known > 0 and (self.judged or self.known == 1)
