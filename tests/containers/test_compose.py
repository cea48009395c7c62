"""The compose file runs each node of the graph in a container of its own, with few rights."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from winding_ros.graph import GRAPH, LAY_CONTROL, controlled

DOCKER = Path(__file__).parents[2] / "docker"
COMPOSE = yaml.safe_load((DOCKER / "compose.yaml").read_text(encoding="utf-8"))
SERVICES: dict[str, Any] = COMPOSE["services"]


@pytest.mark.parametrize("spec", controlled(), ids=lambda spec: spec.name)
def test_each_node_has_a_service(spec: Any) -> None:
    service = SERVICES[spec.name]
    assert service["command"][:3] == ["python", "-m", spec.package]
    assert service["healthcheck"]["test"][-2:] == ["health", spec.name]
    assert service["restart"] == "on-failure"


def test_the_orchestrator_attaches_to_all_of_them() -> None:
    assert "--attach" in SERVICES["winding"]["command"]
    assert set(SERVICES["winding"]["depends_on"]) == {spec.name for spec in GRAPH}


def test_the_lay_controller_is_there_when_it_is_asked_for() -> None:
    optional = {name for name, service in SERVICES.items() if "profiles" in service}
    assert optional == {LAY_CONTROL.name, "dashboard"}
    assert SERVICES[LAY_CONTROL.name]["profiles"] == ["lay"]


@pytest.mark.parametrize("name", SERVICES)
def test_no_container_has_more_rights_than_it_needs(name: str) -> None:
    service = SERVICES[name]
    assert service["cap_drop"] == ["ALL"]
    assert "network_mode" not in service
    assert "privileged" not in service
    for port in service.get("ports", []):
        assert port.startswith("127.0.0.1:")


def test_what_the_containers_name_is_in_the_image() -> None:
    profile = SERVICES["winding_rig"]["environment"]["FASTRTPS_DEFAULT_PROFILES_FILE"]
    recipe = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
    assert f"COPY docker/{Path(profile).name} docker/{Path(profile).name}" in recipe
    assert "HEALTHCHECK" in recipe
    assert "USER ${WINDING_UID}" in recipe
    kept = (DOCKER / "Dockerfile.dockerignore").read_text(encoding="utf-8")
    assert f"!docker/{Path(profile).name}" in kept
