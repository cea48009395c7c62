"""`winding dashboard`: serve the operator's page of a running graph or of a bag being played."""

from pathlib import Path
from typing import Annotated

import typer

from winding_cli.terminal.record_options import Domain, Namespace, Typed, spelled, with_options
from winding_cli.terminal.refusal import refuse, refused
from winding_cli.terminal.ros_environment import check_namespace, joined
from winding_core.error_verdict import ErrorLimit
from winding_core.lay.errors import LayTolerance
from winding_core.parameters import ParameterError, build, typed_values
from winding_core.run_options import OperatorLimits


@with_options(LayTolerance, ErrorLimit)
def dashboard(
    judged: Typed,
    errors: Typed,
    *,
    namespace: Namespace = "winding",
    domain: Domain = None,
    host: Annotated[
        str, typer.Option(help="Address to serve on; others than loopback need a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port of the page.")] = 8080,
    token_file: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            dir_okay=False,
            help="File of the secret that a browser must bring, mode 0600; else "
            "WINDING_DASHBOARD_TOKEN of the environment.",
        ),
    ] = None,
    runs: Annotated[
        Path | None, typer.Option(help="Folder whose runs are listed with verdict and report.")
    ] = None,
) -> None:
    """Serve the operator's page; Ctrl-C ends it."""
    from winding_ros.environment import enclave_arguments, ros_arguments
    from winding_ros.graph import PAGE

    try:
        from winding_dashboard.__main__ import main
        from winding_dashboard.ros.parameters import DashboardParameters
    except ModuleNotFoundError as error:
        if error.name not in ("starlette", "uvicorn"):
            raise
        refuse("the page needs its web server: pip install cable-winding-twin[dashboard]")
    values: dict[str, object] = {"host": host, "port": port}
    if token_file is not None:
        values["token_file"] = str(token_file.absolute())
    if runs is not None:
        if not runs.is_dir():
            refuse(f"--runs {runs} is no folder")
        values["runs"] = str(runs.absolute())
    with refused(ParameterError):
        values |= typed_values(OperatorLimits, {**judged, **errors}, spelled)
        build(DashboardParameters, values, owner="winding dashboard").check()
    if namespace:
        check_namespace(namespace)
    with joined(domain):
        words = [*enclave_arguments(namespace, PAGE.name), *ros_arguments(namespace)]
        raise typer.Exit(main(["winding_dashboard", *words], values))
