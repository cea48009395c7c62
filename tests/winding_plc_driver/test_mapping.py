"""A mapping file is taken as it is meant, or refused in one sentence."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from winding_plc_driver.machine.mapping import (
    MappingError,
    parse_mapping,
    read_mapping,
    read_password,
)

EXAMPLE = Path(__file__).parents[2] / "examples" / "opcua_machine.yaml"


def parse(folder: Path, **sections: dict[str, Any]) -> Any:
    """Return the example's mapping with keys of its sections changed; None takes one out."""
    content = yaml.safe_load(EXAMPLE.read_text(encoding="utf-8"))
    for section, changes in sections.items():
        content[section] = {
            key: value
            for key, value in (content.get(section, {}) | changes).items()
            if value is not None
        }
    return parse_mapping(yaml.safe_dump(content), folder)


def test_values_become_si() -> None:
    mapping = read_mapping(EXAMPLE)
    assert mapping.variables["angle"].factor == math.pi / 180.0
    assert mapping.axes == ("angle", "carriage", "angular_speed", "feed_speed")
    assert mapping.commands["quick_stop"].method.endswith("QuickStop")


def test_a_plc_without_quick_stop_is_stopped(tmp_path: Path) -> None:
    command = {"node": "ns=3;i=7", "value": 2}
    mapping = parse(tmp_path, commands={"quick_stop": None, "stop": command})
    assert mapping.commands["quick_stop"] == mapping.commands["stop"]
    assert mapping.commands["stop"].value == 2


@pytest.mark.parametrize(
    ("section", "changes", "sentence"),
    [
        ("server", {"queue": 5}, "server has no parameter queue; did you mean queue_size?"),
        ("server", {"endpoint": None}, "endpoint must be an address such as"),
        ("server", {"endpoint": "opc.tcp://me:secret@plc:4840"}, "without a user name"),
        ("server", {"queue_size": "many"}, "parameter queue_size must be a int, got 'many'"),
        ("server", {"publishing_interval_s": 20}, "must be at most 10, got 20"),
        ("server", {"security_policy": "Basic128"}, "must be one of None, Basic256Sha256"),
        ("server", {"security_policy": "Basic256Sha256"}, "needs certificate and private_key"),
        ("server", {"user": "me"}, "needs one of password_variable and password_file"),
        ("server", {"user_certificate": "me.der"}, "certificate needs its key and the other way"),
        ("server", {"user_private_key": "me.pem"}, "certificate needs its key and the other way"),
        (
            "server",
            {
                "user": "me",
                "password_file": "word",
                "user_certificate": "c",
                "user_private_key": "k",
            },
            "a session has one user, by name or by certificate, got user 'me'",
        ),
        ("variables", {"angle": None}, "variables needs angle"),
        ("variables", {"angel": {}}, "variables has no parameter angel; did you mean angle?"),
        ("variables", {"angle": 3}, "variable angle must be a mapping of names, got 3"),
        ("variables", {"angle": {"unit": "deg"}}, "node of variable angle must be a node id"),
        ("variables", {"angle": {"node": "Angle", "unit": "deg"}}, "node id such as"),
        ("variables", {"angle": {"node": "i=3", "unit": "mm"}}, "must be one of rad, deg, turn"),
        ("variables", {"carriage": {"node": "i=3", "unit": "mm", "scale": 0}}, "must not be 0"),
        ("variables", {"carriage": {"node": "i=3", "unit": "mm", "wraps_at": 9}}, "only the angle"),
        ("commands", {"reset": None}, "commands needs reset"),
        ("commands", {"stop": {"method": "i=3"}}, "object and method, or node and value"),
        ("commands", {"stop": {"node": "i=3", "value": 0.5}}, "true, false or a whole number"),
        ("state", {"names": {"a": "b"}}, "names of state must give a text for each number"),
        ("state", {"faults": 2}, "faults of state must be a list"),
        ("heartbeat", {"read": 3}, "parameter read must be a str, got 3"),
        ("heartbeat", {"write": "Alive"}, "write of heartbeat must be a node id"),
        ("joints", {}, "the file has no parameter joints"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    section: str, changes: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(MappingError) as refusal:
        parse(tmp_path, **{section: changes})
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_file_that_is_missing_or_no_yaml_is_named(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    with pytest.raises(MappingError, match=r"machine\.yaml cannot be read"):
        read_mapping(file)
    file.write_text("server: [", encoding="utf-8")
    with pytest.raises(MappingError, match=r"machine\.yaml: "):
        read_mapping(file)


def test_a_password_comes_from_where_the_file_says(tmp_path: Path) -> None:
    (tmp_path / "word").write_text("secret\n", encoding="utf-8")
    by_file = parse(tmp_path, server={"user": "me", "password_file": "word"}).server
    assert read_password(by_file, {}) == "secret"
    by_variable = parse(tmp_path, server={"user": "me", "password_variable": "WORD"}).server
    assert read_password(by_variable, {"WORD": "hidden"}) == "hidden"
    with pytest.raises(MappingError, match="WORD, which is not set"):
        read_password(by_variable, {})
