"""`python -m winding_verification.commissioning`: hidden cells, commissioned one by one."""

import argparse

from cable_fem_node.identification import IdentificationError
from winding_verification.commissioning.study import commissioned_cell, study_text


def main() -> None:
    """Print every cell as it is done, and what came of all."""
    parser = argparse.ArgumentParser(prog="python -m winding_verification.commissioning")
    parser.add_argument("--cells", type=int, default=40, help="How many hidden cells.")
    parser.add_argument("--first-seed", type=int, default=0, help="Seed of the first.")
    parser.add_argument(
        "--no-plain", action="store_true", help="Leave out the run as in the paper beside each."
    )
    asked = parser.parse_args()
    cells, refused = [], []
    for seed in range(asked.first_seed, asked.first_seed + asked.cells):
        try:
            cell = commissioned_cell(seed, plain=not asked.no_plain)
        except IdentificationError as error:
            refused.append(seed)
            print(f"seed {seed}: not identified: {error}", flush=True)
            continue
        cells.append(cell)
        outside = [
            f"{item.name} {cell.hidden[item.name]:.4g} not in {item.low:.4g}..{item.high:.4g}"
            for item in cell.commissioned.found
            if item.name in cell.hidden and not item.low <= cell.hidden[item.name] <= item.high
        ]
        print(
            f"seed {seed}, case {cell.case}: {cell.motion}; chi-square "
            f"{cell.commissioned.chi_square:.1f} of {cell.commissioned.measured}; next run "
            f"at most {abs(cell.missed).max():.2%}; {cell.cpu:.1f} s; outside: {outside}",
            flush=True,
        )
    print(study_text(cells, refused))


if __name__ == "__main__":
    main()
