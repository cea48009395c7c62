"""The trained factor on disk: numbers as safetensors, everything about them in card.json."""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from correction_node.models.dataset import conditions_of
from correction_node.models.factor_models import FactorModel, ProcessModel, read_model
from correction_node.models.place import PlaceModel, read_place
from correction_node.models.process import NORMAL_90
from correction_node.models.uncertainty import Bound, TrainingBox
from winding_core.cable.cases import Case

SCHEMA = "cable-winding-twin/correction-weight/2"
WEIGHTS_FILE = "weights.safetensors"
CARD_FILE = "card.json"
_RANGES = ("cylinder_diameter", "cable_diameter", "weight", "young")
# Name of shipped weights: the data and the model that they were learned with.
SHIPPED = {
    "rod": ("rod", "rig network"),
    "rod_without_4": ("rod-4", "rig network"),
    "rod_rig": ("rod", "rig"),
    "rod_marker_network": ("rod", "marker network"),
    "rod_network": ("rod", "network"),
    "paper": ("paper", "network"),
}


@dataclass(frozen=True, kw_only=True)
class Factor:
    """What multiplies the predicted lengths of one condition."""

    by_marker: tuple[float, ...]  # h of P1, P2, ..; 1 outside the trained conditions
    relative_bound: float  # Half-width of the interval around h S_FEM, as a share of it
    outside: str | None  # Why the condition is outside the trained ones, or None
    bounds: tuple[float, ...] = ()  # Of P1, P2, .., where each has its own
    # Of P1, P2, ..; empty where places are the prediction's.
    z_path: tuple[float, ...] = ()  # z of the prediction that is shifted, less z_slope S [m]
    z_shift: tuple[float, ...] = ()  # z beyond the prediction's at one length [m]
    z_slope: tuple[float, ...] = ()  # dz / dS there
    z_sigma: tuple[float, ...] = ()  # One standard deviation of the corrected z [m]

    @property
    def h(self) -> float:
        """The last marker's h; every marker's where the model gives one h per case."""
        return self.by_marker[-1]


@dataclass(frozen=True, kw_only=True)
class TrainedFactor:
    """A fitted h with its reach and its uncertainty."""

    name: str  # Of the model, as in the card's errors
    model: FactorModel  # Gives h
    law: str  # Material law of the solver whose lengths h multiplies
    box: TrainingBox  # Conditions that it was trained on
    bound: Bound  # Interval inside the box
    outside_bound: float  # Relative half-width outside the box, where nothing is promised
    card: dict[str, Any]  # What the numbers come from and how good they are; JSON values only
    place: PlaceModel | None = None  # Where a marker of a length lies; None: as predicted

    @property
    def errors(self) -> dict[str, float]:
        """The model's own errors in percent: in_sample_pct, leave_one_case_out_pct, .."""
        return dict(self.card["errors"][self.name])

    def factor(self, case: Case, law: str | None = None) -> Factor:
        """Return the factor for a condition.

        Args:
            case: What is wound.
            law: Material law of the solver that predicts; None for the trained one.
        """
        outside = self.box.outside(case)
        if outside is None and law not in (None, self.law):
            outside = f"law {law} is not the trained {self.law}: no correction"
        if outside is not None:
            return Factor(
                by_marker=(1.0,) * case.marker_count,
                relative_bound=self.outside_bound,
                outside=outside,
            )
        conditions = conditions_of(case, self.law)
        h = self.model.h(conditions)
        factor = Factor(
            by_marker=tuple(h.tolist()), relative_bound=self.bound.relative, outside=None
        )
        if isinstance(self.model, ProcessModel):
            bounds = tuple(self.model.bounds(conditions).tolist())
            factor = replace(factor, bounds=bounds, relative_bound=bounds[-1])
        if self.place is None:
            return factor
        s_fem = np.array([condition.s_fem for condition in conditions])
        theta, z, sigma = self.place.place(conditions, h * s_fem)
        slope = self.place.slope(conditions, theta)
        if factor.bounds:
            # The length is not known either.
            along = slope * np.array(factor.bounds) * h * s_fem / NORMAL_90
            sigma = np.hypot(sigma, along)
        predicted = self.place.predicted.place(conditions, s_fem)[1]
        shift = z - predicted - slope * (h - 1.0) * s_fem
        return replace(
            factor,
            z_path=tuple((predicted - slope * s_fem).tolist()),
            z_shift=tuple(shift.tolist()),
            z_slope=tuple(slope.tolist()),
            z_sigma=tuple(sigma.tolist()),
        )


def weights_directory(name: str) -> Path:
    """Return the folder of shipped weights, one of SHIPPED, or the path of another."""
    if name in SHIPPED:
        return Path(str(files("correction_node").joinpath("trained", name)))
    return Path(name)


def save_factor(factor: TrainedFactor, directory: Path) -> None:
    """Write weights and card into a folder, which is made when missing."""
    place = {} if factor.place is None else factor.place.tensors()
    content = save_tensors({**factor.model.tensors(), **place}, metadata={"schema": SCHEMA})
    card = {
        "schema": SCHEMA,
        **factor.card,
        "name": factor.name,
        "form": factor.model.form(),
        "law": factor.law,
        "weights_sha256": hashlib.sha256(content).hexdigest(),
        "box": {name: ends for name, ends in asdict(factor.box).items() if ends != ()},
        "bound": asdict(factor.bound),
        "outside_bound": factor.outside_bound,
    }
    directory.mkdir(parents=True, exist_ok=True)
    (directory / WEIGHTS_FILE).write_bytes(content)
    (directory / CARD_FILE).write_text(
        json.dumps(card, indent=2, allow_nan=False) + "\n", encoding="utf-8"
    )


def load_factor(directory: Path) -> TrainedFactor:
    """Return the factor that `save_factor` wrote.

    Raises:
        FileNotFoundError: There are no trained weights in the folder.
        ValueError: The files are not trained weights, do not belong together, or are damaged.
    """
    weights_file, card_file = directory / WEIGHTS_FILE, directory / CARD_FILE
    if not (weights_file.is_file() and card_file.is_file()):
        raise FileNotFoundError(
            f"no trained weights at {directory}: name one of {', '.join(SHIPPED)}, or a folder "
            "that `winding train --output` has written"
        )
    content = weights_file.read_bytes()
    try:
        card = json.loads(card_file.read_text(encoding="utf-8"))
        foreign = card["schema"] != SCHEMA
        digest = card["weights_sha256"]
        box = TrainingBox(
            turns=card["box"]["turns"],
            cables=tuple((d, young) for d, young in card["box"].get("cables", ())),
            **{name: tuple(card["box"][name]) for name in _RANGES if name in card["box"]},
        )
        bound = Bound(**card["bound"])
        outside_bound = float(card["outside_bound"])
        name, form, law = card["name"], card["form"], card["law"]
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ValueError(f"{card_file} is not a card of trained weights: {error!r}") from error
    if foreign:
        raise ValueError(f"{card_file} has schema {card['schema']!r}, expected {SCHEMA!r}")
    if hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(
            f"{weights_file} does not match its card, so it is damaged or of other weights: "
            "restore both files, or train them anew with `winding train --output`"
        )
    model, place = _model(form, content, weights_file)
    return TrainedFactor(
        name=name,
        model=model,
        place=place,
        law=law,
        box=box,
        bound=bound,
        outside_bound=outside_bound,
        card=card,
    )


def _model(
    form: dict[str, Any], content: bytes, source: Path
) -> tuple[FactorModel, PlaceModel | None]:
    try:
        tensors = load_tensors(content)
        model, place = read_model(form, tensors), read_place(tensors)
    except (SafetensorError, KeyError, TypeError, ValueError, IndexError) as error:
        raise ValueError(f"{source} does not hold the trained model: {error!r}") from error
    if not all(np.isfinite(values).all() for values in tensors.values()):
        raise ValueError(f"{source} holds a number that is not finite")
    return model, place
