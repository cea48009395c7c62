"""Evaluate the tracker: python -m winding_verification.tracker films 1001 1007, or sightings."""

import argparse
from collections.abc import Iterator
from typing import TypeVar

from winding_verification.tracker.drawn_runs import drawn, drawn_summary
from winding_verification.tracker.filmed_runs import filmed, summary

Run = TypeVar("Run")


def main() -> None:
    """Print what came of every run of the seeds, and counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", choices=("sightings", "films"))
    parser.add_argument("first", type=int, help="seed of the first run")
    parser.add_argument("end", type=int, help="seed behind the last run")
    wanted = parser.parse_args()
    seeds = range(wanted.first, wanted.end)
    if wanted.runs == "films":
        print(summary(_shown(filmed(seeds))))
    else:
        print(drawn_summary(_shown(drawn(seeds))))


def _shown(runs: Iterator[Run]) -> Iterator[Run]:
    for one in runs:
        print(one, flush=True)
        yield one


if __name__ == "__main__":
    main()
