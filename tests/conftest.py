"""What tests share: a Context and an executor per test, composed graphs, commands, drivers."""

import importlib
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

# Helpers stand beside the tests; colcon runs these from where no setting of pytest names them.
sys.path += [str(folder) for folder in Path(__file__).parent.iterdir() if folder.is_dir()]

from processes import COMMAND, in_namespace, ran, running

PATIENCE = 60.0  # A test waits ten times as long as the thing usually takes, on two busy cores


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--run-soak", action="store_true", help="also run for minutes on end")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--run-soak"):
        skip = pytest.mark.skip(reason="minutes on end, with --run-soak")
        for item in items:
            if item.get_closest_marker("soak"):
                item.add_marker(skip)


class Ros:
    """Nodes of one test on a private context, spun by one executor."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor

        self.context = Context()
        rclpy.init(context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self._nodes: list[Any] = []

    def add(
        self,
        factory: Callable[..., Any],
        *args: Any,
        parameters: Mapping[str, object] | None = None,
        **kwargs: Any,
    ) -> Any:
        """Make a node on the private context, its parameters set, and spin it with the others."""
        from rclpy.parameter import Parameter

        if parameters is not None:
            kwargs["parameter_overrides"] = [Parameter(n, value=v) for n, v in parameters.items()]
        node = factory(*args, context=self.context, **kwargs)
        self._nodes.append(node)
        self.executor.add_node(node)
        return node

    def plain(self, name: str = "probe") -> Any:
        """Make a node without parameters or topics of its own."""
        from rclpy.node import Node

        return self.add(Node, name)

    def spin_until(self, reached: Callable[[], Any], patience: float = PATIENCE) -> None:
        """Spin until a predicate holds; fail the test when it does not in time."""
        end = time.monotonic() + patience
        while not reached():
            if time.monotonic() > end:
                pytest.fail(f"not reached in {patience:g} s")
            self.executor.spin_once(timeout_sec=0.05)

    def call(self, node: Any, service: type, name: str, request: Any) -> Any:
        client = node.create_client(service, name)
        self.spin_until(client.service_is_ready)
        future = client.call_async(request)
        self.spin_until(future.done)
        return future.result()

    def close(self) -> None:
        import rclpy

        for node in self._nodes:
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def ros() -> Iterator[Ros]:
    harness = Ros()
    yield harness
    harness.close()


@pytest.fixture(scope="module")
def module_ros() -> Iterator[Ros]:
    """One harness for a module whose tests look at the same run."""
    harness = Ros()
    yield harness
    harness.close()


class ComposedGraph:
    """The graph's nodes in this process on one executor, brought up in the graph's order.

    Args:
        ros: Spins the nodes.
        parameters: Node name -> parameter name -> value.
        namespace: Of the graph.
        direct_frames: Hand frames from rig to tracker within the process; camera/image_raw is
            silent then.
        specs: The nodes, sinks first; the usual graph by default.
    """

    def __init__(
        self,
        ros: Ros,
        parameters: Mapping[str, Mapping[str, Any]],
        *,
        namespace: str = "",
        direct_frames: bool = False,
        specs: Any = None,
    ) -> None:
        from rclpy.lifecycle import TransitionCallbackReturn
        from rclpy.parameter import Parameter

        from winding_ros import graph
        from winding_ros.environment import ros_arguments
        from winding_ros.runtime.managed_node import ManagedNode

        self._ros = ros
        self.nodes: dict[str, Any] = {}
        for spec in specs or graph.GRAPH:
            module = importlib.import_module(f"{spec.package}.node")
            (node_class,) = (
                item
                for item in vars(module).values()
                if isinstance(item, type)
                and ManagedNode in item.__bases__
                and item.__module__ == module.__name__
            )
            values = {"use_sim_time": True, **parameters.get(spec.name, {})}.items()
            self.nodes[spec.name] = node_class(
                context=ros.context,
                cli_args=ros_arguments(namespace),
                parameter_overrides=[Parameter(name, value=value) for name, value in values],
            )
            ros.executor.add_node(self.nodes[spec.name])
        if direct_frames:
            rig, tracker = self.nodes[graph.RIG.name], self.nodes[graph.TRACKER.name]
            rig.frame_listener = tracker.take_frame
        for transition in ("trigger_configure", "trigger_activate"):
            for node in self.nodes.values():
                assert getattr(node, transition)() is TransitionCallbackReturn.SUCCESS

    def close(self) -> None:
        """Stop and destroy the nodes, the rig first."""
        for node in reversed(self.nodes.values()):
            self._ros.executor.remove_node(node)
            node.destroy_node()


@pytest.fixture(scope="session")
def compose() -> type[ComposedGraph]:
    """Compose the graph of nodes in this process."""
    return ComposedGraph


def winding(
    *arguments: object, cwd: Path, patience: float = 240.0, code: int | None = None, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run the `winding` command in a folder, as a person would; see that it ends with a code."""
    done = ran(*COMMAND, *arguments, cwd=cwd, timeout=patience, **options)
    assert code in (None, done.returncode), done.stdout + done.stderr
    return done


@dataclass(frozen=True, kw_only=True)
class RecordedRun:
    """A run of real processes with everything that it left behind."""

    duration: float
    bag: Path
    report: Path
    json: Path
    finished: subprocess.CompletedProcess[str]


@pytest.fixture(scope="session")
def recorded_run(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Wind the first seconds of case 4 with four processes, recorded."""
    folder = tmp_path_factory.mktemp("run")
    duration = 5.0
    bag, report, json = folder / "bag", folder / "report", folder / "run.json"
    finished = winding(
        "run", "--case", 4, "--speed", 0, "--duration-s", duration,
        "--bag", bag, "--report", report, "--json", json,
        cwd=folder, code=0,
    )  # fmt: skip
    return RecordedRun(duration=duration, bag=bag, report=report, json=json, finished=finished)


@pytest.fixture(scope="session")
def command() -> Callable[..., subprocess.CompletedProcess[str]]:
    return winding


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 1 MB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = shutil.which("mount")
    done = mount and ran(mount, "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk)
    if not done or done.returncode != 0:
        pytest.skip("only root may mount a file system of 1 MB")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


EXAMPLE_DRIVER = Path(__file__).parents[1] / "examples" / "driver_node.py"


@dataclass(frozen=True, kw_only=True)
class Driver:
    """A machine's driver in a process of its own.

    Attributes:
        namespace: Where it publishes.
        process: Its process.
    """

    namespace: str
    process: "subprocess.Popen[str]"


@pytest.fixture
def driver(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Driver]:
    """Run the example driver, its source changed as the test asks: old text to new text."""
    source = EXAMPLE_DRIVER.read_text(encoding="utf-8")
    for old, new in getattr(request, "param", {}).items():
        assert old in source
        source = source.replace(old, new)
    script = tmp_path / "driver.py"
    script.write_text(source, encoding="utf-8")
    namespace = "driven"
    with running(script, *in_namespace(namespace), ready="ready", cwd=tmp_path) as process:
        yield Driver(namespace=namespace, process=process)
