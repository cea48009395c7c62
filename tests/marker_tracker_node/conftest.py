"""Films of winding runs for the tracker under test."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

# Modules beside the tests are imported by name.
sys.path.insert(0, str(Path(__file__).parent))

from marker_film import DRIVE, FREE_LENGTH, Film, FilmMaker, Frames, smooth_lay

from winding_core.cable.cases import paper_case
from winding_rig_node.lay.known_lay import published_lay


@pytest.fixture(scope="session")
def paper_film() -> FilmMaker:
    """A function that films a case of the paper as it was measured."""

    def film(number: int, **changes: object) -> Film:
        case = paper_case(number)
        lay = published_lay(case, DRIVE, FREE_LENGTH, DRIVE.positions(20.0)[0])
        return Film(case=case, lay=lay, **changes)  # type: ignore[arg-type]

    return film


@pytest.fixture(scope="session")
def smooth_film() -> FilmMaker:
    """A function that films a cable on the fleet-angle law."""

    def film(number: int, stretch: float = 1.0, **changes: object) -> Film:
        case = paper_case(number)
        return Film(case=case, lay=smooth_lay(case, stretch), **changes)  # type: ignore[arg-type]

    return film


@pytest.fixture(scope="session")
def filmed(paper_film: FilmMaker) -> tuple[Film, Frames]:
    """Case 4, and its pictures, which are the same whatever a tracker is configured with."""
    film = paper_film(4)
    return film, [(t, frame) for t, frame, *_ in film.frames(40.0)]
