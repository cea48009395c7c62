"""Every field of the condition reaches nodes, commands, sweeps and the page under one name."""

import dataclasses
import inspect

import pytest

from winding_cli.commands.identify import identify
from winding_cli.commands.plan import plan
from winding_cli.commands.predict import predict
from winding_cli.commands.run import run
from winding_cli.commands.track import track
from winding_core.condition import Condition
from winding_core.options import option_kinds, options
from winding_core.parameters import declarations
from winding_dashboard.page.condition_form import FIELDS, LAWS
from winding_ros.graph import GRAPH, parameters_of
from winding_study.run_parameters import RunParameters

NAMES = {item.name for item in dataclasses.fields(Condition)}
KEYS = set(options(Condition))


def test_every_field_is_an_option() -> None:
    assert {item.name for item in options(Condition).values()} == NAMES
    assert len(KEYS) == len(NAMES)


def test_every_node_takes_every_field() -> None:
    for spec in GRAPH:
        assert {item.name for item in declarations(parameters_of(spec))} >= NAMES, spec.name


@pytest.mark.parametrize("command", [predict, plan, run, track, identify], ids=lambda c: c.__name__)
def test_every_command_takes_every_option(command: object) -> None:
    assert set(inspect.signature(command).parameters) >= KEYS  # type: ignore[arg-type]


def test_every_option_can_be_swept() -> None:
    assert set(option_kinds(RunParameters)) >= KEYS


def test_every_option_is_a_field_of_the_page() -> None:
    assert set(FIELDS) | {"case", "law"} == KEYS
    assert set(LAWS) == set(options(Condition)["law"].choices or ())
