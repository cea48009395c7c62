"""What a start imports: the heavy libraries wait for those who use them."""

import os

import pytest

from processes import python
from winding_ros.graph import GRAPH

# Each costs a process between a tenth and a whole second of processor time.
HEAVY = (
    "scipy.integrate", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.sparse",
    "scipy.spatial", "scipy.special", "scipy.stats", "sklearn", "joblib", "matplotlib", "pinocchio",
    "torch", "uvicorn", "pyarrow", "rosbags", "mcap", "asyncua",
)  # fmt: skip
CORES = ("numpy", "numba", "cv2", "rclpy", "yaml")  # What a core is made of; help needs no core


def loaded(code: str, names: tuple[str, ...]) -> list[str]:
    """Return which of some modules a process has loaded after it has run code."""
    ask = f"{code}\nimport sys\nprint(*[name for name in {names!r} if name in sys.modules])"
    # What counts lines imports modules of its own.
    own = {name: value for name, value in os.environ.items() if "COVERAGE" not in name}
    return python(ask, check=True, timeout=120, env=own).stdout.splitlines()[-1].split()


@pytest.mark.parametrize("spec", GRAPH, ids=lambda spec: spec.package)
def test_a_node_starts_without_what_it_does_not_need_before_the_machine_moves(spec) -> None:
    assert loaded(f"import {spec.package}.node", HEAVY) == []


@pytest.mark.parametrize("spec", GRAPH, ids=lambda spec: spec.package)
def test_parameters_of_a_node_are_known_without_its_kernels(spec) -> None:
    kernels = ("numba", "cv2", "rclpy")
    assert loaded(f"import {spec.package}.ros.parameters", (*HEAVY, *kernels)) == []


def test_a_run_begins_without_what_its_report_needs() -> None:
    code = "import winding_cli.commands.run, winding_supervisor.session.run"
    assert loaded(code, (*HEAVY, "numba", "cv2", "jinja2")) == []


def test_a_prediction_needs_numpy_and_numba_alone() -> None:
    code = command("predict", "--case", "4", "--duration-s", "0.1")
    # Numba imports scipy.linalg by itself.
    needless = {*HEAVY, "rclpy", "cv2"} - {"scipy.linalg"}
    assert loaded(code, tuple(needless)) == []


@pytest.mark.parametrize("words", [["--help"], []])
def test_help_imports_no_command(words: list[str]) -> None:
    commands = ("winding_cli.commands.run", "winding_core", "winding_ros")
    assert loaded(command(*words), (*HEAVY, *CORES, *commands)) == []


def command(*words: str) -> str:
    """Return code that runs the command and shows nothing."""
    return (
        "import contextlib, io, sys\n"
        "from winding_cli.app import app\n"
        f"sys.argv = ['winding', *{words!r}]\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n"
        "    app()"
    )
