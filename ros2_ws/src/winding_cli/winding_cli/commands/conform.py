"""`winding conform`: does a machine's driver provide what the graph needs?"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.terminal.console import result_console
from winding_cli.terminal.record_options import Domain, Typed, spelled, with_options
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_cli.terminal.ros_environment import joined
from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import PAPER_ANGULAR_SPEED, PAPER_FEED_SPEED
from winding_core.parameters import typed_record
from winding_core.run_options import TRANSPORTS
from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from winding_cli.cell.driver_judgement import Finding


@with_options(MachineAxes)
def conform(
    axes: Typed,
    *,
    namespace: Annotated[str, typer.Option(help="Namespace of the driver.")] = "winding",
    domain: Domain = None,
    seconds: Annotated[float, typer.Option(min=0.5, help="How long to listen.")] = 3.0,
    camera: Annotated[
        bool, typer.Option("--camera/--no-camera", help="Whether the driver brings a camera.")
    ] = True,
    image_transport: Annotated[
        str, typer.Option(help="How the camera's frames come: raw, or compressed.")
    ] = "raw",
    move: Annotated[
        bool,
        typer.Option("--move", help="Also start, stop and emergency-stop the machine. It MOVES."),
    ] = False,
    omega_rad_s: Annotated[
        float, typer.Option(help="Cylinder speed when it winds.")
    ] = PAPER_ANGULAR_SPEED,
    feed_mm_s: Annotated[float, typer.Option(help="Carriage speed when it winds.")] = (
        PAPER_FEED_SPEED / MILLIMETRE
    ),
    stop_within_s: Annotated[float, typer.Option(help="Longest time to standstill.")] = 1.5,
) -> None:
    """Listen to a running driver and report, promise by promise, what it keeps."""
    for name, value in (
        ("omega-rad-s", omega_rad_s),
        ("feed-mm-s", feed_mm_s),
        ("stop-within-s", stop_within_s),
    ):
        if not value > 0.0:
            refuse(f"--{name} must be positive, got {value}")
    if image_transport not in TRANSPORTS:
        refuse(f"--image-transport must be {' or '.join(TRANSPORTS)}, got {image_transport}")
    with refused(ValueError):
        known = typed_record(MachineAxes, axes, spelled)
    with joined(domain) as place, refused(ValueError, code=FAILED):
        try:
            findings, commanded = asyncio.run(
                probed(
                    namespace,
                    transport=image_transport if camera else "",
                    axes=known,
                    seconds=seconds,
                    running=(omega_rad_s, MILLIMETRE * feed_mm_s) if move else None,
                    stop_within=stop_within_s,
                )
            )
        except TimeoutError as error:
            refuse(
                f"{error}; is a driver running in namespace /{namespace}, domain {place.domain}?",
                FAILED,
            )
    console = result_console()
    for finding in findings:
        mark = "[green]kept  [/]" if finding.kept else "[red]BROKEN[/]"
        console.print(f"{mark}  {finding.promise}: {finding.measured}")
    broken = sum(not finding.kept for finding in findings)
    console.print(f"{len(findings) - broken} of {len(findings)} promises kept")
    if not move:
        console.print(
            "The machine was not moved: --move also tries start, stop, reset and commands."
        )
    elif not commanded:
        console.print("Nothing listens to rig/joint_targets: commands were not tried.")
    if broken:
        raise typer.Exit(FAILED)


async def probed(
    namespace: str,
    *,
    transport: str,
    axes: MachineAxes,
    seconds: float,
    running: tuple[float, float] | None,
    stop_within: float,
) -> tuple[list[Finding], bool]:
    """Return what was found, and whether the machine took commands.

    Frames come by a transport, one of `TRANSPORTS`; there is no camera where it is empty.
    """
    from winding_cli.cell.driver_probe import Probe
    from winding_ros import topics
    from winding_ros.client.async_client import AsyncClient

    frames = {"raw": topics.IMAGE, "compressed": topics.PREVIEW}.get(transport)
    client = AsyncClient(namespace)
    try:
        probe = Probe(client, frames=frames, axes=axes)
        client.start()
        await probe.listen(seconds)
        findings = [*await probe.services(), *probe.findings()]
        if running is not None:
            if not all(finding.kept for finding in findings):
                return findings, True
            findings += await probe.moves(running, stop_within)
            findings += probe.findings()[len(probe.heard) :]
        return findings, probe.commanded
    finally:
        client.close()
