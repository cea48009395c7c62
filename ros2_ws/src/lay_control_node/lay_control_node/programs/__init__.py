"""Which lay is wanted: programs from files and options, and what of them cannot be wound?"""

from lay_control_node.programs.feasibility import crossings, refuse_beyond, refuse_overlap
from lay_control_node.programs.reading import read_program
from lay_control_node.programs.simple_programs import even_helix, with_markers_every_turn

__all__ = [
    "crossings",
    "even_helix",
    "read_program",
    "refuse_beyond",
    "refuse_overlap",
    "with_markers_every_turn",
]
