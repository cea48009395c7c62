"""What is computed beside a node's own thread."""

import subprocess
import sys

import pytest

PROGRAM = """
import os, threading
os.setpriority(os.PRIO_PROCESS, 0, {niceness})
from cable_fem_node.ros.background import BackgroundTask
task = BackgroundTask(lambda wanted: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
print(task.result())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="a niceness per thread is Linux's")
@pytest.mark.parametrize(("niceness", "expected"), [(10, 15), (17, 19)])
def test_a_nice_process_has_nicer_tasks(niceness: int, expected: int) -> None:
    # Whoever is not root may raise a niceness and never lower it.
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(niceness=niceness)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) == expected
