"""Evaluate the tracker: python -m winding_verification.tracker films 1001 1007."""

from __future__ import annotations

import sys

from winding_verification.tracker.filmed_runs import filmed, summary

if __name__ == "__main__":
    first, last = (int(word) for word in sys.argv[2:4])
    found = []
    for one in filmed(range(first, last)):
        found.append(one)
        print(
            f"{one.seed} {one.wrong.number or 'right'} {one.wrong.size:+.4g}: {one.kind}, "
            f"named {','.join(one.named) or '-'}, known {one.known}, far {one.far:.1f}, "
            f"refused {one.refused}, {'healthy' if one.healthy else 'not healthy'}"
        )
        for text in one.sentences:
            print(f"    {text}")
        sys.stdout.flush()
    print(summary(found))
