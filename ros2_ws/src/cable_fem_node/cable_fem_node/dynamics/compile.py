"""How the solver's kernels are compiled: sums may be reordered, a division by zero is infinite."""

from functools import partial

from winding_core import compiling

# NaN must stay visible to the divergence check, so "nnan" and "ninf" are left out.
_REORDER = {"reassoc", "contract", "arcp", "nsz"}

kernel = partial(compiling.compiled, fastmath=_REORDER, error_model="numpy")
# What is called with a literal stays a kernel: in a called function the literal would be one
# argument among others, and sums that may be reordered would round differently.
called = partial(compiling.called, nogil=True, fastmath=_REORDER, error_model="numpy")
is_compiled = partial(compiling.is_compiled, "cable_fem_node")
