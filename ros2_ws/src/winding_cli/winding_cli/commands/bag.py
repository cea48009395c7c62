"""`winding bag`: look into recordings, check, recover, play, replay and export them."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from winding_cli.commands.condition_options import Typed, spelled, with_options
from winding_cli.commands.console import result_console
from winding_cli.commands.extras import need_extra
from winding_cli.commands.output_path import check_output_folder, staged
from winding_cli.commands.refusal import FAILED, refuse, refused
from winding_cli.commands.ros_environment import joined
from winding_cli.commands.space_key import space_key
from winding_cli.commands.termination import end
from winding_core.error_verdict import ErrorLimit
from winding_core.lay_tolerance import LayTolerance
from winding_core.units import MEGABYTE, MILLISECOND

bag = typer.Typer(
    help="Look into recordings, check, recover, play, replay and export them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
Source = Annotated[Path, typer.Argument(help="rosbag2 folder, or one .mcap or .db3 file.")]


@bag.command()
def info(source: Source) -> None:
    """Say what a recording holds, and what never reached the recorder."""
    from rich.table import Table

    from winding_recorder.bags.contents import contents
    from winding_recorder.bags.description import COMPLETE, RECOVERED, BagError

    with refused(BagError, code=FAILED):
        content = contents(source)
    console = result_console()
    size = sum(content.files.values()) / MEGABYTE
    console.print(f"{source}: {content.duration:.3f} s from {content.start:.3f} s, {size:.2f} MB")
    for name, length in content.files.items():
        console.print(f"  {name}  {length / MEGABYTE:.2f} MB", highlight=False)
    if COMPLETE in content.notes:
        console.print(f"complete: {content.notes[COMPLETE]}", highlight=False)
    if RECOVERED in content.notes:
        console.print(f"recovered from: {content.notes[RECOVERED]}", highlight=False)
    wound = _wound(content.notes)
    if wound:
        console.print(f"wound: {wound}", highlight=False)
    table = Table("topic", "type", box=None, padding=(0, 2))
    for heading in ("messages", "Hz", "lost"):
        table.add_column(heading, justify="right")
    for topic in content.topics:
        rate = (topic.messages - 1) / content.duration if content.duration > 0.0 else 0.0
        table.add_row(
            topic.name,
            topic.type_name,
            str(topic.messages),
            f"{rate:.1f}" if topic.messages > 1 else "-",
            "not counted" if topic.lost is None else str(topic.lost),
        )
    console.print(table)


def _wound(notes: Mapping[str, str]) -> str:
    """Return what a recording says of the condition, as it would be typed."""
    import json

    from winding_core.condition import Condition
    from winding_core.options import shown_values
    from winding_recorder.bags.description import PARAMETERS

    stated: dict[str, Any] = {}
    try:
        for name, text in notes.items():
            if name.startswith(PARAMETERS):
                stated |= json.loads(text)
    except (TypeError, ValueError):
        return "not readable"
    return ", ".join(f"{name} {value}" for name, value in shown_values(Condition, stated).items())


@bag.command()
def check(source: Source) -> None:
    """Look for damage: every checksum, message, count and stamp. Exit code 1 if there is any."""
    from winding_recorder.bags.check import check as look
    from winding_recorder.bags.description import BagError

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
    from winding_recorder.bags.description import BagError
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
    domain: Annotated[
        int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")
    ] = None,
) -> None:
    """Publish a recording again: the same bytes, the same rhythm, and /clock.

    The space key pauses and goes on; so do bag_player/toggle_paused (std_srvs/Trigger) and
    bag_player/set_paused (std_srvs/SetBool).
    """
    from winding_recorder.bags.description import BagError
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
        Path | None,
        typer.Option(help="ROS parameter file in place of what the recording says."),
    ] = None,
) -> None:
    """Feed recorded inputs to one node's work and compare its answers. Exit code 1 if they differ.

    No ROS graph is needed. Two replays of one recording give the same bytes.
    """
    from winding_recorder.bags.description import BagError
    from winding_recorder.playback.replay import REPLAYABLE
    from winding_recorder.playback.replay import replay as feed
    from winding_ros.graph import DEFAULT_NAMESPACE
    from winding_ros.parameter_files import parameters_for

    own = None
    if parameters is not None and not parameters.is_file():
        refuse(f"--parameters: there is no file {parameters}")
    with refused(OSError, ValueError):
        if parameters is not None and node in REPLAYABLE:
            own = parameters_for(parameters, f"/{DEFAULT_NAMESPACE}/{REPLAYABLE[node].name}")
    try:
        result = feed(source, node, tolerance=tolerance, parameters=own)
    except BagError as error:
        refuse(error, FAILED)
    except ValueError as error:
        refuse(error)
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
    from winding_cli.commands.bag_report import write_recorded_report
    from winding_cli.commands.wanted_lay import held_against
    from winding_core.options import typed_values
    from winding_core.parameters import build
    from winding_recorder.bags.description import BagError

    with refused(ValueError):
        held = held_against(judged)
        limit = typed_values(ErrorLimit, errors, spelled)
        kept = build(ErrorLimit, limit, owner="winding bag report")
    check_output_folder(out, "--output", new=True)
    with refused(BagError, code=FAILED):
        write_recorded_report(source, out, held, kept.error_limit_pct, errors_held=bool(limit))


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
    from winding_recorder.bags.description import BagError
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
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.node import Node

    context = Context()
    rclpy.init(context=context, signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node = Node("bag_player", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin() -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            return

    thread = threading.Thread(target=spin, name="bag_player", daemon=True)
    thread.start()
    try:
        yield node
    finally:
        executor.shutdown()
        thread.join()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
