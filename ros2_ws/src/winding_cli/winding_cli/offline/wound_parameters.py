"""The condition that a cell file, a cable of the library and options state."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from winding_cli.terminal.record_options import Typed, typed_with_cable
from winding_core.parameters import Spelling, typed_values
from winding_core.run_spec import SECTION_OF, RunSpec
from winding_study.run_parameters import RunParameters


def wound_parameters(
    typed: Typed,
    *,
    cell: Path | None = None,
    cable: str | None = None,
    library: Path | None = None,
    spelling: Spelling = str,
) -> RunParameters:
    """Return what is wound; options win over the cable, and both over the cell file.

    Args:
        typed: By option, in the unit of its name.
        cell: Cell file; None for none.
        cable: Name or file of a cable; None for none.
        library: Folder of own cables; None for the user's.
        spelling: How a refusal writes an option's name.

    Raises:
        ParameterError: A file, a value or a combination is refused.
    """
    if cell is None:
        return RunParameters.from_typed(typed_with_cable(typed, cable, library), spelling=spelling)
    named = {"cable": cable, "library": library}
    of_run = {key: value for key, value in typed.items() if key in SECTION_OF} | {
        key: value for key, value in named.items() if value is not None
    }
    own = {key: value for key, value in typed.items() if key not in SECTION_OF}
    spec = RunSpec.from_cell(cell, of_run, spelling)
    values: dict[str, Any] = asdict(spec.condition) | asdict(spec.solver)
    return RunParameters(**values | typed_values(RunParameters, own, spelling))
