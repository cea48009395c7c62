"""Evaluate the tracker: python -m winding_verification.tracker films 1001 1007, or sightings."""

from __future__ import annotations

import argparse

from winding_verification.tracker.drawn_runs import drawn, drawn_summary
from winding_verification.tracker.filmed_runs import filmed, summary


def main() -> None:
    """Print what came of every run of the seeds, and counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", choices=("sightings", "films"))
    parser.add_argument("first", type=int, help="seed of the first run")
    parser.add_argument("end", type=int, help="seed behind the last run")
    wanted = parser.parse_args()
    seeds = range(wanted.first, wanted.end)
    found = []
    for one in filmed(seeds) if wanted.runs == "films" else drawn(seeds):
        found.append(one)
        print(one, flush=True)
    print(summary(found) if wanted.runs == "films" else drawn_summary(found))


if __name__ == "__main__":
    main()
