"""Pictures of a recorded run: what the camera saw, the machine, and the lengths so far."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from machine_drawing import Machine
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from marker_tracker_node.camera.frame_sources import read_bag
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.markers import (
    CABLE_DTYPE,
    CORRECTED_DTYPE,
    MARKER_DTYPE,
    MarkerFlag,
    is_wound,
    positions,
)
from winding_recorder.bags.contents import configuration_of, recorded_parameters
from winding_recorder.bags.reading import decoded, opened, stamped_messages
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud

# Simulated time between two pictures [s]; how long one is shown, one with markers in the camera's
# window, and the last one [ms].
STEP, PERIOD_MS, SEEN_MS, LAST_MS = 0.1, 60, 105, 1000
WIDTH, HEIGHT, DPI = 960, 600, 100
PREDICTED, CORRECTED, TRACKED = "#1f6fb5", "#e2711d", "#2a9d4a"
SERIES = (
    ("predicted", topics.FEM_MARKERS, MARKER_DTYPE, PREDICTED, 1.6),
    ("tracked", topics.TRACKED_MARKERS, MARKER_DTYPE, TRACKED, 4.0),
    ("corrected", topics.CORRECTED_MARKERS, CORRECTED_DTYPE, CORRECTED, 1.6),
)
FACE, INK = "#f7f8fa", "#22272e"


@dataclass(kw_only=True)
class Instant:
    """What was recorded at one time, by name of its topic."""

    t: float
    messages: dict[str, Any] = field(default_factory=dict)


def pictures(bag: Path) -> tuple[list[Image.Image], list[int]]:
    """Return the pictures of a recording, one every `STEP`, and how long each is shown [ms].

    Raises:
        BagError: It cannot be read, or does not say what was wound.
    """
    what = configuration_of(Condition, recorded_parameters(bag, topics.FEM), topics.FEM).resolved()
    instants = _recorded(bag)
    camera = read_bag(bag).camera
    if camera is None:
        raise SystemExit(f"{bag} has no {topics.CAMERA_INFO.name}")
    machine = Machine(
        radius=what.case.cylinder_radius,
        cable_radius=what.case.cable_radius,
        free_length=what.free_length,
        travel=float(what.drive.positions(instants[-1].t)[1]),
    )
    newest: dict[tuple[str, int], tuple[float, float]] = {}
    drawn, shown = [], []
    for instant in instants:
        for name, topic, *_ in SERIES:
            for marker in _wound(instant.messages[topic.name]):
                first = newest.get((name, marker["id"]), (instant.t, 0.0))[0]
                newest[name, int(marker["id"])] = (first, float(marker["s"]))
        drawn.append(_picture(instant, what, machine, camera, newest, instants[-1].t))
        in_sight = len(_in_window(instant, camera)[0]) > 0
        shown.append(SEEN_MS if in_sight else PERIOD_MS)
    return drawn, [*shown[:-1], LAST_MS]


def _recorded(bag: Path) -> list[Instant]:
    clouds = {topic.name: dtype for _, topic, dtype, *_ in SERIES}
    clouds[topics.FEM_CABLE.name] = CABLE_DTYPE
    others = (topics.IMAGE.name, topics.JOINT_STATES.name, topics.TENSION.name)
    instants: dict[int, Instant] = {}
    with opened(bag) as reader:
        wanted = {
            link.topic: name
            for link in reader.connections
            for name in (*clouds, *others)
            if link.topic.endswith(f"/{name}")
        }
        links = [link for link in reader.connections if link.topic in wanted]
        for link, stamp, _, data in stamped_messages(reader, links):
            number = round(stamp * 1e-9 / STEP)
            if abs(stamp * 1e-9 - number * STEP) > 1e-4:
                continue
            name = wanted[link.topic]
            instant = instants.setdefault(number, Instant(t=number * STEP))
            instant.messages[name] = (
                decode_cloud(data, clouds[name])[1]
                if name in clouds
                else decoded(reader, link, data)
            )
    whole = len(clouds) + len(others)
    return [instants[n] for n in sorted(instants) if len(instants[n].messages) == whole]


def _wound(markers: NDArray[np.void]) -> NDArray[np.void]:
    return markers[is_wound(markers) & (markers["id"] > 0) & np.isfinite(markers["s"])]


def _picture(
    instant: Instant,
    what: ResolvedCondition,
    machine: Machine,
    camera: Any,
    newest: dict[tuple[str, int], tuple[float, float]],
    end: float,
) -> Image.Image:
    angle, guide = instant.messages[topics.JOINT_STATES.name].position[:2]
    tracked = instant.messages[topics.TRACKED_MARKERS.name]
    with mpl.rc_context({"font.size": 9.0, "font.family": "DejaVu Sans", "text.color": INK}):
        figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI, facecolor=FACE)
        _title(figure, instant, what, angle)
        _camera_view(_part(figure, 0, 40, WIDTH, 144), instant, camera)
        view = _part(figure, 8, 214, 470, 374)
        _limit(view, machine)
        machine.draw(
            view,
            float(angle),
            float(guide),
            positions(instant.messages[topics.FEM_CABLE.name]),
            positions(tracked[is_wound(tracked) & np.isfinite(tracked["s"])]),
        )
        figure.text(
            0.012, 0.633, "The cable as the solver lays it, the markers as the camera finds them"
        )
        _lengths(_part(figure, 545, 214, 400, 208), instant, what, newest, end)
        _table(figure, what, newest)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        rgba = np.asarray(canvas.buffer_rgba())
    return Image.fromarray(rgba[..., :3].copy())


def _part(figure: Figure, left: int, top: int, width: int, height: int) -> Axes:
    """Return axes that fill a part of the picture [px]."""
    return figure.add_axes(
        (left / WIDTH, 1.0 - (top + height) / HEIGHT, width / WIDTH, height / HEIGHT)
    )


def _title(figure: Figure, instant: Instant, what: ResolvedCondition, angle: float) -> None:
    case = what.case
    pull = instant.messages[topics.TENSION.name].wrench.force.x
    cable, cylinder = 1e3 * case.cable_diameter, 1e3 * case.cylinder_diameter
    wound = f"Case {case.number}: cable of {cable:g} mm on a cylinder of {cylinder:g} mm"
    figure.text(0.012, 0.952, wound, fontsize=12.0, weight="bold")
    now = f"{instant.t:5.1f} s   {angle / (2.0 * math.pi):4.1f} turns   {pull:.2f} N"
    figure.text(0.988, 0.952, now, fontsize=12.0, ha="right", family="DejaVu Sans Mono")


def _in_window(instant: Instant, camera: Any) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Return pixels, shape (n, 2), and numbers of the markers that are measured in this picture."""
    tracked = instant.messages[topics.TRACKED_MARKERS.name]
    unseen = MarkerFlag.PREDICTED | MarkerFlag.NOT_WOUND | MarkerFlag.OCCLUDED
    seen = tracked[((tracked["flags"] & unseen) == 0) & np.isfinite(tracked["s"])]
    pixels = camera.pixels(seen)
    inside = ((pixels >= 0.0) & (pixels < camera.shape[::-1])).all(axis=1)
    return pixels[inside], seen["id"][inside]


def _camera_view(axes: Axes, instant: Instant, camera: Any) -> None:
    message = instant.messages[topics.IMAGE.name]
    frame = np.asarray(message.data).reshape(message.height, message.width, 3)[..., ::-1]
    brighter = np.clip(frame * 1.5, 0, 255).astype(np.uint8)
    axes.imshow(brighter, interpolation="bicubic", aspect="auto")
    axes.set(xlim=(0, message.width), ylim=(message.height, 0))
    axes.axis("off")
    for (column, row), number in zip(*_in_window(instant, camera), strict=True):
        axes.plot(column, row, "s", mfc="none", mec="#5dff8f", ms=24.0, mew=2.0)
        axes.text(
            column, row - 18, f"P{number}", color="#5dff8f", weight="bold", ha="center",
            bbox={"facecolor": INK, "edgecolor": "none", "pad": 1.0},
        )  # fmt: skip
    caption = "camera, window of 640 x 96 at 200 frames/s; green: measured in this frame"
    axes.text(634, 91, caption, color="white", fontsize=8.0, ha="right")


def _limit(axes: Axes, machine: Machine) -> None:
    across, along = machine.limits()
    axes.set(xlim=across, ylim=along, aspect="equal")
    axes.axis("off")


def _lengths(
    axes: Axes,
    instant: Instant,
    what: ResolvedCondition,
    newest: dict[tuple[str, int], tuple[float, float]],
    end: float,
) -> None:
    case = what.case
    times = np.linspace(0.0, instant.t, 200)
    laid = np.hypot(case.centreline_radius, what.drive.advance_per_radian)
    axes.plot(times, 1e3 * laid * what.drive.positions(times)[0], color="#b4bac2", lw=1.5)
    for name, _, _, colour, width in SERIES:
        axes.plot([], [], color=colour, lw=width, label=name)
        for (series, _), (first, length) in newest.items():
            if series == name:
                axes.plot([first, instant.t], [1e3 * length] * 2, color=colour, lw=width)
    last = what.case.marker_count * case.marker_spacing * case.expected_stretch
    axes.set(xlim=(0.0, end), ylim=(0.0, 1.12e3 * last), xlabel="time, s")
    axes.set_title("Length from P0, mm; grey: wound so far", loc="left", fontsize=9.0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_facecolor(FACE)
    axes.legend(loc="upper left", frameon=False, fontsize=8.5)


def _table(
    figure: Figure, what: ResolvedCondition, newest: dict[tuple[str, int], tuple[float, float]]
) -> None:
    columns = (0.62, 0.73, 0.84, 0.95)
    for (name, _, _, colour, _), at in zip(SERIES, columns[1:], strict=True):
        figure.text(at + 0.03, 0.185, name, color=colour, ha="right", weight="bold")
    figure.text(columns[0] - 0.04, 0.185, "mm")
    for n in range(1, what.case.marker_count + 1):
        height = 0.185 - 0.042 * n
        figure.text(columns[0] - 0.04, height, f"P{n}", weight="bold")
        for (name, _, _, colour, _), at in zip(SERIES, columns[1:], strict=True):
            known = newest.get((name, n))
            text = "-" if known is None else f"{1e3 * known[1]:.1f}"
            figure.text(at + 0.03, height, text, color=colour, ha="right")
