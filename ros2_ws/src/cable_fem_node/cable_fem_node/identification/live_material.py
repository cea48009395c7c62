"""The material of the run that is being wound: when to identify it, and what follows from it."""

import copy
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from importlib import import_module

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.identification.modulus import ModulusEstimate, identify_modulus, with_young
from cable_fem_node.identification.search import FitConfig, RodExcess
from cable_fem_node.identification.steady import SteadyConfig, SteadyMarkers
from cable_fem_node.identification.tracked_run import IdentificationError, Readings, TrackedRun
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import RunAhead, replay
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.machine.drive import DriveProfile
from winding_core.markers import Markers
from winding_core.run_inputs import Inputs, RunHistory, RunInputs, planned_rest

# Beside a machine that winds, a call of the rod is dear. After a step within the standard error it
# would move the estimate by less than a fifth of that, and the next marker brings it anyway.
_LIVE = FitConfig(tolerance=1.0)


@dataclass(frozen=True, kw_only=True)
class MaterialTask:
    """An identification that is due."""

    config: WindingConfig  # The model; its modulus is where the search begins
    inputs: Inputs  # Of the run so far
    readings: Readings  # Markers that have landed
    drive: DriveProfile  # The plan of the run
    duration: float  # Planned time of the run [s]
    wanted_ahead: bool  # Whether the rest of the run is to be wound with the estimate
    before: RodExcess | None = None  # The rod's answers to the previous search


@dataclass(frozen=True, kw_only=True)
class MaterialUpdate:
    """What an identification found."""

    estimate: ModulusEstimate | None  # None where there is none
    refusal: str  # Why the estimate is not used; empty where it may be
    config: WindingConfig | None = None  # The model with the estimate; None with a refusal
    # The rod with the estimate, wound up to the last of the task's inputs; None unless it was
    # wanted.
    model: RodWinding | None = None
    # The rest of the run with the estimate, not yet wound; None unless it was wanted.
    ahead: RunAhead | None = None


@dataclass(eq=False)
class LiveMaterial:
    """Watches a run's tracked markers and decides when an identification is due.

    It is due whenever a further marker has landed and stands still.
    """

    config: WindingConfig  # The model that the run began with
    drive: DriveProfile  # The plan of the run
    duration: float  # Planned time [s]
    _: KW_ONLY
    take_up: bool  # Whether the run is to go on with what is found
    steady: SteadyConfig | None = None  # When a marker counts as measured

    def __post_init__(self) -> None:
        self._markers = SteadyMarkers(self.steady)
        self._used: tuple[int, ...] = ()
        self._excess: RodExcess | None = None

    def see(self, markers: Markers) -> None:
        """Take one frame's tracked markers."""
        self._markers.add(markers)

    def due(self, history: RunHistory) -> MaterialTask | None:
        """Return the identification that is due with the run so far; None if there is none."""
        steady = self._markers.steady()
        if len(history) < 2 or not set(steady) - set(self._used):
            return None
        readings = self._markers.readings()
        if readings is None:
            return None
        self._used = steady
        return MaterialTask(
            config=self.config,
            inputs=history.inputs,
            readings=readings,
            drive=self.drive,
            duration=self.duration,
            wanted_ahead=self.take_up,
            before=self._excess,
        )

    def learn(self, update: MaterialUpdate) -> None:
        """Begin the next search where the last one ended."""
        if update.config is not None and update.estimate is not None:
            self.config = update.config
            self._excess = update.estimate.fit.excess


def load_search() -> None:
    """Import what a search computes with: half a processor second, for before the machine moves.

    Beside the node's own thread it would hold the interpreter for a tenth of a second at a time.
    """
    for module in ("scipy.linalg", "scipy.optimize", "scipy.special"):
        import_module(module)


def work_out(task: MaterialTask, going: Callable[[], bool] = lambda: True) -> MaterialUpdate:
    """Identify the modulus and, where wanted, wind the run so far again with it.

    Takes a processor second or two; nothing that it touches is shared.

    Raises:
        AbandonedError: `going` returned False.
    """
    try:
        run = TrackedRun(config=task.config, inputs=task.inputs, readings=task.readings)
        estimate = identify_modulus([run], _LIVE, going=going, before=task.before)
    except IdentificationError as error:
        return MaterialUpdate(estimate=None, refusal=str(error))
    refusal = estimate.refusal()
    if refusal:
        return MaterialUpdate(estimate=estimate, refusal=refusal)
    try:
        config = with_young(task.config, estimate.young)
        if not task.wanted_ahead:
            return MaterialUpdate(estimate=estimate, refusal="", config=config)
        model = RodWinding(config)
        replay(task.inputs, model, going)
        # The model itself stays where the run is.
        end = copy.deepcopy(model)
        rest = RunInputs(samples=planned_rest(task.inputs, task.drive, task.duration))
        ahead = RunAhead(end, rest)
    except (ValueError, SolverError) as error:
        return MaterialUpdate(
            estimate=estimate, refusal=f"the run cannot be wound with it: {error}"
        )
    return MaterialUpdate(estimate=estimate, refusal="", config=config, model=model, ahead=ahead)
