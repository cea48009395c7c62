"""Who takes part in a session of runs."""

from collections.abc import Callable
from dataclasses import dataclass

from winding_recorder.live.recorder import Recorder
from winding_ros.client.async_client import AsyncClient
from winding_supervisor.machines.machine import Machine
from winding_supervisor.processes.orchestrator import Orchestrator
from winding_supervisor.session.dashboard_process import DashboardProcess
from winding_supervisor.session.rest import Rest
from winding_supervisor.session.run_parts import TraceRecording
from winding_supervisor.watch.event_log import EventLog
from winding_supervisor.watch.supervisor import Supervisor


@dataclass(frozen=True, kw_only=True)
class Participants:
    """Who takes part in a session."""

    client: AsyncClient  # The orchestrator's node
    recorder: Recorder  # Of every run
    machine: Machine  # What winds
    orchestrator: Orchestrator  # Of the nodes
    supervisor: Supervisor  # Of nodes and machine
    log: EventLog  # Has what supervision did, and the cause of the present run's end
    rest: Rest  # Ends the machine's motion
    page: DashboardProcess | None  # The operator's
    trace: TraceRecording | None  # Of the corrected lengths
    report: Callable[[str], None]  # Takes sentences for the terminal
