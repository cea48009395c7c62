"""`winding bag`: look into recordings, check, recover, play, replay and export them."""

import select
import sys
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from winding_cli.app import command_group
from winding_cli.terminal.console import Shown, record_table, result_console
from winding_cli.terminal.output_path import check_output_folder, staged
from winding_cli.terminal.record_options import Domain, Typed, spelled, with_options
from winding_cli.terminal.refusal import FAILED, need_extra, refuse, refused
from winding_cli.terminal.ros_environment import joined, plain_node
from winding_cli.terminal.termination import end
from winding_core.cable.condition import Condition
from winding_core.error_verdict import ErrorLimit
from winding_core.lay.errors import LayTolerance
from winding_core.parameters import ParameterError, shown_values, typed_record
from winding_core.run_options import OperatorLimits
from winding_core.units import MEGABYTE, MILLISECOND
from winding_recorder.bags.description import COMPLETE, PARAMETERS, RECOVERED, BagError

_KEY_PERIOD = 0.1
_DATES = 1e9  # A bag time below is no date: the year 2001 [s]

bag = command_group(__doc__)


def _existing(source: Path) -> Path:
    if not source.exists():
        refuse(f"there is no recording at {source}")
    return source


Source = Annotated[
    Path, typer.Argument(help="rosbag2 folder, or one .mcap or .db3 file.", callback=_existing)
]


@bag.command()
def info(source: Source) -> None:
    """Show what a recording holds, and what never reached the recorder."""
    from winding_recorder.bags.contents import contents

    with refused(BagError, code=FAILED):
        content = contents(source)
    console = result_console()
    size = sum(content.files.values()) / MEGABYTE
    console.print(
        f"{source}: {content.duration:.3f} s from {_moment(content.start)}, {size:.2f} MB"
    )
    for name, length in content.files.items():
        console.print(f"  {name}  {length / MEGABYTE:.2f} MB")
    if COMPLETE in content.notes:
        console.print(f"complete: {content.notes[COMPLETE]}")
    if RECOVERED in content.notes:
        console.print(f"recovered from: {content.notes[RECOVERED]}")
    wound = _wound(content.notes)
    if wound:
        console.print(f"wound: {wound}")
    columns = (
        Shown("topic", lambda topic: topic.name),
        Shown("type", lambda topic: topic.type_name),
        Shown("messages", lambda topic: topic.messages),
        Shown("Hz", lambda topic: topic.rate, ".1f"),
        Shown("lost", lambda topic: topic.lost, missing="not counted"),
    )
    console.print(record_table(columns, content.topics, words=2, box=None, padding=(0, 2)))


def _moment(t: float) -> str:
    """Return a bag time [s] as a date; older recordings count from the beginning of the run."""
    if t < _DATES:
        return f"{t:.3f} s"
    return datetime.fromtimestamp(t, UTC).isoformat(sep=" ", timespec="milliseconds")


def _wound(notes: Mapping[str, str]) -> str:
    """Return the recorded condition, as it would be typed."""
    import json

    recorded: dict[str, Any] = {}
    try:
        for name, text in notes.items():
            if name.startswith(PARAMETERS):
                recorded |= json.loads(text)
    except (TypeError, ValueError):
        return "not readable"
    return ", ".join(f"{name} {value}" for name, value in shown_values(Condition, recorded).items())


@bag.command()
def check(source: Source) -> None:
    """Look for damage: every checksum, message, count and stamp. Exit code 1 if there is any."""
    from winding_recorder.bags.check import check as look

    with refused(BagError, code=FAILED):
        verdict = look(source)
    for sentence in verdict.findings:
        print(f"found: {sentence}")
    for sentence in verdict.remarks:
        print(f"note: {sentence}")
    if verdict.findings:
        raise typer.Exit(FAILED)
    print(f"{source} is whole: {verdict.messages} messages in {len(verdict.stamps)} topics")


@bag.command()
def recover(
    source: Source,
    target: Annotated[Path, typer.Argument(help="New folder; the source is only read.")],
) -> None:
    """Make a readable recording out of one that was cut off or damaged."""
    from winding_recorder.bags.recover import recover as salvage

    check_output_folder(target, new=True)
    with refused(BagError, code=FAILED), staged(target) as place:
        files = salvage(source, place)
    for file in files:
        print(f"{file.name}: kept {file.kept} messages of {file.bytes / MEGABYTE:.2f} MB")
        for loss in file.losses:
            print(f"lost: {loss}")
    print(f"recovered: {target}")


@bag.command()
def play(
    source: Source,
    *,
    rate: Annotated[float, typer.Option(help="Bag seconds per second.")] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Again and again; time jumps back.")] = False,
    start_paused: Annotated[
        bool, typer.Option("--start-paused", help="Wait for the space key or a service.")
    ] = False,
    topics: Annotated[
        str, typer.Option(help="Full topic names with commas between; all otherwise.")
    ] = "",
    force: Annotated[
        bool, typer.Option("--force", help="Publish although the topics have publishers.")
    ] = False,
    domain: Domain = None,
) -> None:
    """Publish a recording again: the same bytes, the same rhythm, and /clock.

    The space key pauses and goes on; so do bag_player/toggle_paused (std_srvs/Trigger) and
    bag_player/set_paused (std_srvs/SetBool). The parameter position of bag_player goes to a place.
    """
    from winding_recorder.playback.player import Pacing, Player

    with refused(ValueError):
        pacing = Pacing(rate, paused=start_paused)
    stopped = threading.Event()
    try:
        with joined(domain), _player_node() as node:
            player = Player(node, source, pacing, wanted=_names(topics), force=force)
            with space_key(player.toggle, stopped):
                player.wait_for_subscribers()
                while True:
                    player.play(stopped.is_set)
                    if not loop:
                        break
            player.drain()
    except BagError as error:
        refuse(error, FAILED)
    except KeyboardInterrupt:
        end()
    finally:
        stopped.set()
    print(
        f"published {player.published} messages, "
        f"latest {player.latest / rate / MILLISECOND:.1f} ms late"
    )


@bag.command()
def replay(
    source: Source,
    *,
    node: Annotated[str, typer.Option(help="tracker, fem or correction.")],
    tolerance: Annotated[
        float, typer.Option(help="Allowed difference, relative to the value or to 1.")
    ] = 1.0e-6,
    parameters: Annotated[
        Path | None, typer.Option(help="ROS parameter file in place of the recorded parameters.")
    ] = None,
) -> None:
    """Feed recorded inputs to one node's work and compare its answers. Exit code 1 if they differ.

    No ROS graph is needed. Two replays of one recording give the same bytes.
    """
    from winding_recorder.playback.replay import REPLAYABLE
    from winding_recorder.playback.replay import replay as feed
    from winding_ros.graph import DEFAULT_NAMESPACE
    from winding_ros.runtime.parameter_files import parameters_for

    own = None
    if parameters is not None and not parameters.is_file():
        refuse(f"--parameters: there is no file {parameters}")
    with refused(OSError, ValueError):
        if parameters is not None and node in REPLAYABLE:
            own = parameters_for(parameters, f"/{DEFAULT_NAMESPACE}/{REPLAYABLE[node].name}")
    with refused(ValueError), refused(BagError, code=FAILED):
        result = feed(source, node, tolerance=tolerance, parameters=own)
    print(f"{result.inputs} messages in, {result.refused} refused, answers {result.digest}")
    for comparison in result.comparisons:
        print(
            f"{comparison.topic}: {comparison.identical} of {comparison.compared} identical, "
            f"{comparison.missing} missing, {comparison.extra} more than recorded"
        )
        for name, difference in sorted(comparison.differences.items()):
            mark = "" if comparison.excess[name] <= 1.0 else "  above the tolerance"
            if difference != 0.0:
                print(f"  {name}: largest difference {difference:.3g}{mark}")
        for name, count in sorted(comparison.mismatches.items()):
            print(f"  {name}: differs {count} times")
    if not result.agrees:
        refuse("the replay differs from the recording", FAILED)


@bag.command()
@with_options(LayTolerance, ErrorLimit)
def report(
    judged: Typed,
    errors: Typed,
    *,
    source: Source,
    out: Annotated[
        Path, typer.Option("--output", "--out", help="New folder of the report and run.json.")
    ],
) -> None:
    """Write the report and the numbers of a recorded run, as `winding run` does.

    Exit code 1 if a limit that is given is not known to be kept.
    """
    given = {**judged, **errors}
    with refused(ValueError):
        limits = typed_record(OperatorLimits, given, spelled)
    check_output_folder(out, "--output", new=True)
    with refused(BagError, ParameterError, code=FAILED):
        write_recorded_report(source, out, limits, given)


@bag.command()
def export(
    source: Source,
    *,
    out: Annotated[Path, typer.Option("--output", "--out", help="New folder of tables.")],
    form: Annotated[str, typer.Option("--format", help="csv or parquet.")] = "csv",
    topics: Annotated[
        str, typer.Option(help="Full topic names with commas between; all otherwise.")
    ] = "",
) -> None:
    """Write a table for every topic; clouds give one row per point."""
    need_extra("tables", "winding bag export")
    from winding_recorder.bags.tables import export as write

    check_output_folder(out, "--output", new=True)
    with refused(BagError, code=FAILED), staged(out) as place:
        files = write(source, place, form, _names(topics))
    for file in files:
        print(out / file.name)


def _names(text: str) -> frozenset[str]:
    return frozenset(name.strip() for name in text.split(",") if name.strip())


@contextmanager
def _player_node() -> Iterator[object]:
    """Yield a node that a thread spins."""
    from rclpy.executors import ExternalShutdownException

    with plain_node("bag_player") as (node, executor):

        def spin() -> None:
            with suppress(ExternalShutdownException):
                executor.spin()

        thread = threading.Thread(target=spin, name="bag_player", daemon=True)
        thread.start()
        try:
            yield node
        finally:
            executor.shutdown()
            thread.join()


def write_recorded_report(
    source: Path, out: Path, limits: OperatorLimits, given: Collection[str]
) -> None:
    """Write index.html and run.json of a recording into a folder, and print the results.

    Args:
        source: The recording.
        out: New folder.
        limits: Of a lay that was driven, and of the errors of the lengths.
        given: Options of those that the command fails for where they are not kept.

    Raises:
        BagError: The recording cannot be read, or has no condition of what was wound.
    """
    from winding_cli.offline.recorded_run import record_of
    from winding_cli.run.delivery import flaw, show, write

    record, result = record_of(source, limits)
    show(record)
    write(record, out, out / "run.json", bags=(source,))
    sentence = flaw(record, result, given)
    if sentence:
        refuse(sentence, FAILED)


@contextmanager
def space_key(toggle: Callable[[], bool], stopped: threading.Event) -> Iterator[None]:
    """Call `toggle` whenever the space key of the terminal is pressed."""
    if not sys.stdin.isatty():
        yield
        return
    import termios
    import tty

    def listen() -> None:
        while not stopped.is_set():
            ready, _, _ = select.select([sys.stdin], [], [], _KEY_PERIOD)
            if ready and sys.stdin.read(1) == " ":
                print("paused" if toggle() else "playing", file=sys.stderr, flush=True)

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    thread = threading.Thread(target=listen, name="keys", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
