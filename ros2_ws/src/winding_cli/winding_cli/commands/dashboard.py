"""`winding dashboard`: serve the operator's page of a running graph or of a bag being played."""

from __future__ import annotations

from typing import Annotated

import typer

from winding_cli.commands.refusal import refuse, refused
from winding_cli.commands.ros_environment import check_namespace, joined


def dashboard(
    namespace: Annotated[str, typer.Option(help="Namespace of the graph.")] = "winding",
    domain: Annotated[
        int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to serve on; others than loopback need a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port of the page.")] = 8080,
    token: Annotated[
        str,
        typer.Option(envvar="WINDING_DASHBOARD_TOKEN", help="Secret that a browser must bring."),
    ] = "",
    lay_tolerance_mm: Annotated[
        float | None,
        typer.Option(help="Band around a wanted lay, from the third turn on; 0.5 by default."),
    ] = None,
) -> None:
    """Serve the operator's page; Ctrl-C ends it."""
    from winding_cli.commands.run_checks import given
    from winding_cli.commands.wanted_lay import held_against
    from winding_core.parameters import ParameterError, build
    from winding_ros.environment import ros_arguments

    try:
        from winding_dashboard.__main__ import main
        from winding_dashboard.ros.parameters import DashboardParameters
    except ModuleNotFoundError as error:
        if error.name not in ("starlette", "uvicorn"):
            raise
        refuse("the page needs its web server: pip install cable-winding-twin[dashboard]")
    values: dict[str, object] = {"host": host, "port": port, "token": token}
    with refused(ParameterError):
        values |= held_against(given(lay_tolerance_mm=lay_tolerance_mm)).of_page
        build(DashboardParameters, values, owner="winding dashboard").check()
    if namespace:
        check_namespace(namespace)
    with joined(domain):
        raise typer.Exit(main(["winding_dashboard", *ros_arguments(namespace)], values))
