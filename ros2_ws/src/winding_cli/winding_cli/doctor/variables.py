"""Variables of the environment that change what ROS does."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from winding_cli.doctor.finding import Finding, fail, ok, warn

RMW = "rmw_fastrtps_cpp"
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_UNWANTED = {
    "ROS_LOCALHOST_ONLY": f"it is deprecated and overrides {_RANGE}",
    "ROS_STATIC_PEERS": "nodes look for others on those machines too",
    "ROS_DISCOVERY_SERVER": "nodes find each other only through it",
}


def judge_variables(
    environment: Mapping[str, str], is_file: Callable[[str], bool]
) -> list[Finding]:
    """Return one finding for each variable that matters, as it was before the command set any.

    Args:
        environment: Variables by name.
        is_file: Whether a path leads to a file.
    """
    return [
        _middleware(environment.get("RMW_IMPLEMENTATION")),
        _discovery_range(environment.get(_RANGE)),
        *(
            warn(name, f"{environment[name]!r}: {effect}", f"unset {name} unless you need it")
            if name in environment
            else ok(name, "not set")
            for name, effect in _UNWANTED.items()
        ),
        _profiles(environment.get(_PROFILES), is_file),
    ]


def _middleware(value: str | None) -> Finding:
    check = "RMW_IMPLEMENTATION"
    if not value:
        return ok(check, f"not set; {RMW} is the wheels' only one")
    if value == RMW:
        return ok(check, value)
    return fail(check, f"{value}; the graph is made for {RMW}", f"unset {check}")


def _discovery_range(value: str | None) -> Finding:
    if not value:
        return ok(_RANGE, "not set; the command keeps to this host")
    if value == "LOCALHOST":
        return ok(_RANGE, value)
    if value in ("SUBNET", "SYSTEM_DEFAULT"):
        return warn(
            _RANGE,
            f"{value}: other machines see the graph and may publish into it",
            f"unset {_RANGE} unless they have to",
        )
    reason = "nodes do not find each other" if value == "OFF" else "no such range"
    return fail(_RANGE, f"{value}: {reason}", f"unset {_RANGE}")


def _profiles(value: str | None, is_file: Callable[[str], bool]) -> Finding:
    if value is None:
        return ok(_PROFILES, "not set; the command sets the graph's own")
    if not value or not is_file(value):
        effect = "is no file; Fast DDS complains and keeps to its defaults"
        return warn(_PROFILES, f"{value!r} {effect}", f"unset {_PROFILES}")
    return warn(
        _PROFILES,
        f"{value} takes the place of the graph's own, with its transports and leases",
        f"unset {_PROFILES} unless you need it",
    )
