"""Runs of an external machine that do not end well: one outcome on terminal, run.json and page."""

import html
import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.processes, pytest.mark.campaign, pytest.mark.timeout(600)]

TURNED = (
    "            self.angle += self.share * OMEGA * PERIOD  # your encoder of the cylinder [rad]\n"
)
SERVE = 'f"rig/{name}", getattr(self, name)'
UNSERVED = {SERVE: '"rig/" + ("no_" * ("stop" in name)) + name, getattr(self, name)'}


class ExternalRun:
    """`winding run --machine external` in a process of its own."""

    def __init__(self, namespace: str, folder: Path, further: list[str]) -> None:
        self.folder = folder
        self.output = (folder / "output.txt").open("w+", encoding="utf-8")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "winding_cli.cli", "run", "--case", "4", "--machine", "external",
             "--no-camera", "--namespace", namespace, "--duration-s", "9", "--standing-s", "3",
             "--output", str(folder / "run"), *further],
            stdout=self.output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )  # fmt: skip

    @property
    def text(self) -> str:
        return (self.folder / "output.txt").read_text(encoding="utf-8")

    def until(self, words: str) -> None:
        end = time.monotonic() + 240.0
        while words not in self.text:
            assert self.process.poll() is None, self.text
            assert time.monotonic() < end, self.text
            time.sleep(0.05)

    def outcome(self) -> Any:
        """Return the outcome of the run, which all three outputs print alike."""
        numbers = json.loads((self.folder / "run" / "run.json").read_text(encoding="utf-8"))
        page = (self.folder / "run" / "report" / "index.html").read_text(encoding="utf-8")
        shown = html.unescape(re.sub(r"<[^>]+>", "", page))
        assert numbers["outcome"]["sentences"]
        for sentence in numbers["outcome"]["sentences"]:
            assert sentence in self.text
            assert sentence in shown
        return numbers["outcome"]


@pytest.fixture
def wind(driver: Any, tmp_path: Path) -> Iterator[Callable[..., ExternalRun]]:
    runs = []

    def begin(*further: str) -> ExternalRun:
        runs.append(ExternalRun(driver.namespace, tmp_path, list(further)))
        return runs[-1]

    yield begin
    for run in runs:
        run.process.kill()
        run.process.wait()
        run.output.close()


@pytest.mark.parametrize(
    "driver",
    [{TURNED: TURNED + "            self.goal *= self.angle < 5.5\n"}],
    indirect=True,
)
def test_a_machine_that_stops_by_itself_has_not_finished(wind: Callable[..., ExternalRun]) -> None:
    run = wind()
    assert run.process.wait(300.0) == 1
    outcome = run.outcome()
    assert (outcome["ended_by"], outcome["verdict"]) == ("machine", "failed")
    assert "the machine stopped by itself after" in outcome["cause"]["text"]
    assert outcome["done"]["turns"] < 0.6 * outcome["asked"]["turns"]
    assert outcome["machine"] == "standing"
    assert "the machine stands after" in run.text


@pytest.mark.parametrize("driver", [UNSERVED], indirect=True)
@pytest.mark.parametrize("interrupted", [False, True], ids=["at its end", "at Ctrl-C"])
def test_a_machine_that_does_not_stop_is_never_finished(
    wind: Callable[..., ExternalRun], interrupted: bool
) -> None:
    run = wind("--turns", "900" if interrupted else "1.3")
    if interrupted:
        run.until("of 9.00 s simulated")
        run.process.send_signal(signal.SIGINT)
    assert run.process.wait(300.0) == 1
    outcome = run.outcome()
    assert outcome["ended_by"] == ("signal" if interrupted else "completed")
    assert outcome["machine"] == "turning"
    assert outcome["verdict"] == "failed"
    assert outcome["sentences"][0].startswith("THE MACHINE still turns: ")
    assert [stop["failure"] != "" for stop in outcome["stops"]] == [True] * len(outcome["stops"])
    assert len(outcome["stops"]) > 1


@pytest.mark.parametrize("driver", [{}], indirect=True)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_whose_machine_stands_then(
    wind: Callable[..., ExternalRun], number: signal.Signals
) -> None:
    run = wind()
    run.until("of 9.00 s simulated")
    run.process.send_signal(number)
    assert run.process.wait(300.0) == 130
    outcome = run.outcome()
    assert (outcome["ended_by"], outcome["verdict"]) == ("signal", "incomplete")
    assert outcome["cause"]["text"] == f"{number.name} came"
    assert (outcome["machine"], [stop["failure"] for stop in outcome["stops"]]) == (
        "standing",
        [""],
    )


@pytest.mark.parametrize("driver", [{}], indirect=True)
def test_the_first_cause_stays_when_the_stop_fails(
    driver: Any, wind: Callable[..., ExternalRun]
) -> None:
    run = wind()
    run.until("of 9.00 s simulated")
    driver.process.send_signal(signal.SIGSTOP)
    try:
        assert run.process.wait(300.0) == 1
    finally:
        driver.process.send_signal(signal.SIGCONT)
    outcome = run.outcome()
    assert outcome["ended_by"] == "machine"
    assert "are silent for" in outcome["cause"]["text"]
    assert outcome["machine"] == "unknown"
    assert outcome["sentences"][0].startswith("THE MACHINE was not seen standing")
    assert "not stopped" in [event["what"] for event in outcome["events"]]
