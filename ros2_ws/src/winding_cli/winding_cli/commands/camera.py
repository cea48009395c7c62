"""What a camera is: `winding render`, `board`, `calibrate`, `play-film` and `check-film`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.terminal.console import busy
from winding_cli.terminal.output_path import Force, check_output_file, check_output_folder, staged
from winding_cli.terminal.record_options import Domain, Namespace, Typed, spelled, with_options
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_cli.terminal.ros_environment import check_namespace, joined, plain_node
from winding_cli.terminal.termination import end
from winding_core.cable.cases import paper_case
from winding_core.cable.condition import Condition
from winding_core.helix import PAPER_FREE_LENGTH
from winding_core.machine.drive import DriveProfile
from winding_core.markers import DOT, MarkerLook, MarkerParameters
from winding_core.parameters import parameter, typed_record
from winding_core.raw_image import ENCODINGS
from winding_core.run_options import CameraPixels, CameraPlacement
from winding_core.units import LENGTH, MILLIMETRE, MILLISECOND, PLAIN

if TYPE_CHECKING:
    from marker_tracker_node.camera.calibration import Board
    from winding_rig_node.camera import Scene

_CHECKED = 500  # Frames that `winding check-film` looks at, from the first on

Film = Annotated[Path, typer.Argument(help="Video file, folder of pictures, or bag.")]
CameraFile = Annotated[
    Path | None, typer.Option("--camera", help="Camera YAML; a bag may bring its own camera_info.")
]
Fps = Annotated[
    float | None,
    typer.Option(help="Of pictures without times; of a video in place of its own times."),
]


@dataclass(frozen=True, kw_only=True)
class BoardOptions:
    """The calibration board, as it is typed."""

    columns: int = parameter(14, "squares across", PLAIN, 3, 100)
    rows: int = parameter(8, "squares down", PLAIN, 3, 100)
    square: float = parameter(8.0e-3, "side of a square", LENGTH, 1.0e-4, 1.0)
    marker: float = parameter(
        6.0e-3, "side of a ChArUco marker; 0 for a plain chessboard", LENGTH, 0.0, 1.0
    )
    dictionary: str = parameter("DICT_4X4_250", "dictionary of the markers", PLAIN)

    @staticmethod
    def board(typed: Typed) -> Board:
        """Return the board that was typed.

        Raises:
            ValueError: There is none of that kind.
        """
        from marker_tracker_node.camera.calibration import Board

        wanted = typed_record(BoardOptions, typed, spelled)
        return Board(**{**vars(wanted), "marker": wanted.marker or None})


@with_options(BoardOptions)
def board(
    typed: Typed,
    *,
    out: Annotated[Path, typer.Argument(help="Picture to write, such as board.png.")],
    dpi: Annotated[float, typer.Option(min=50.0, max=2400.0, help="Dots per inch.")] = 600.0,
    force: Force = False,
) -> None:
    """Draw the board that `winding calibrate` looks for; print it at its true size."""
    from marker_tracker_node.camera.calibration import write_board

    check_output_file(out, force=force)
    with refused(ValueError):
        drawn = BoardOptions.board(typed)
        with staged(out) as place:
            width, height = write_board(place, drawn, dpi)
    print(
        f"{out}: print at {dpi:g} dots per inch, {width / MILLIMETRE:.1f} x "
        f"{height / MILLIMETRE:.1f} mm, and measure a square before you trust it"
    )


@with_options(BoardOptions)
def calibrate(
    typed: Typed,
    *,
    pictures: Annotated[list[Path], typer.Argument(help="Photographs, or folders of them.")],
    out: Annotated[Path, typer.Option("--output", "--out", help="Camera YAML to write.")],
    name: Annotated[str, typer.Option(help="Name of the camera.")] = "camera",
    force: Force = False,
) -> None:
    """Fit camera matrix and distortion, and write the YAML that ROS tools read."""
    from marker_tracker_node.camera.calibration import calibrate as fit
    from marker_tracker_node.camera.calibration import write_camera
    from marker_tracker_node.camera.recordings import PICTURES, read_picture

    files = [
        file
        for path in pictures
        for file in (sorted(path.iterdir()) if path.is_dir() else [path])
        if not path.is_dir() or file.suffix.lower() in PICTURES
    ]
    if not files:
        refuse("there is no picture")
    check_output_file(out, "--output", force=force)
    with refused(OSError, ValueError), busy("looking for boards", total=len(files)) as show:
        photographs = []
        for file in files:
            photographs.append(read_picture(file))
            show(advance=1)
        result = fit(photographs, BoardOptions.board(typed))
    with staged(out) as place:
        write_camera(place, result.camera, name)
    print(
        f"{result.views} views ({result.refused} without a board), residual "
        f"{result.residual:.3f} px, focal {result.camera.k[0, 0]:.2f} px, written to {out}"
    )


@with_options(MarkerLook)
def render(
    markers: Typed,
    *,
    folder: Annotated[Path, typer.Argument(help="Where pictures and truth go.")],
    case: Annotated[int, typer.Option(help="Row of the paper's Table 1 (1 to 12).")] = 4,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 50.0,
    start_s: Annotated[float, typer.Option(help="First instant of the run, in seconds.")] = 0.0,
    duration_s: Annotated[float, typer.Option(help="Length of the film in seconds.")] = 20.0,
    full: Annotated[
        bool, typer.Option("--full/--window", help="1920x1080, or 640x96 as the rig streams it.")
    ] = False,
    noise: Annotated[float, typer.Option(help="Read noise in grey levels.")] = 1.5,
    bayer: Annotated[bool, typer.Option("--bayer", help="One colour per pixel.")] = False,
    seed: Annotated[int, typer.Option(help="Of the noise.")] = 1,
    force: Force = False,
) -> None:
    """Render the measured lay of a case: frames, motion.csv, truth.csv, camera.yaml."""
    import numpy as np

    from winding_rig_node.camera import (
        CablePath,
        CameraConfig,
        Paint,
        Renderer,
        Scene,
        SensorNoise,
        paint_of_hue,
    )
    from winding_rig_node.camera.pictures import write_sequence
    from winding_rig_node.lay.known_lay import published_lay

    for option, number in (("--fps", fps), ("--duration-s", duration_s)):
        if not 0.0 < number < math.inf:
            refuse(f"{option} must be positive and finite, got {number:g}")
    for option, number in (("--start-s", start_s), ("--noise", noise)):
        if not 0.0 <= number < math.inf:
            refuse(f"{option} must be finite and not negative, got {number:g}")
    check_output_folder(folder, force=force)
    with refused(ValueError):
        wound, drive = paper_case(case), DriveProfile()
        end = drive.positions(start_s + duration_s)[0]
        lay = published_lay(wound, drive, PAPER_FREE_LENGTH, end)
        path = CablePath(theta=lay.path_theta, z=lay.path_z)
        config = CameraConfig(noise=SensorNoise(read=noise), bayer=bayer)
        renderer = Renderer(config.full_frame() if full else config)
        look = typed_record(MarkerLook, markers, spelled)
        paint = Paint(markers=tuple(paint_of_hue(hue) for hue in look.hues))

    def instants() -> Iterator[tuple[float, Scene]]:
        for k in range(count):
            show(completed=k)
            t = start_s + k / fps
            angle, guide = drive.positions(t)
            yield (
                t,
                Scene(
                    cylinder_radius=wound.cylinder_radius,
                    cable_radius=wound.cable_radius,
                    cylinder_angle=angle,
                    path=path,
                    marker_theta=lay.marker_theta,
                    guide_z=guide,
                    free_length=PAPER_FREE_LENGTH,
                    cylinder_speed=drive.speeds(t)[0],
                    band_width=look.band_width,
                    dot_size=look.dot_size if look.marker_kind == DOT else 0.0,
                    paint=paint,
                ),
            )

    count = round(duration_s * fps)
    with staged(folder) as place, busy("drawing frames", total=count) as show:
        count = write_sequence(place, renderer, instants(), np.random.default_rng(seed))
    print(f"{count} frames of case {case} in {folder}")


def play_film(
    *,
    film: Film,
    camera_file: CameraFile = None,
    motion: Annotated[
        Path | None,
        typer.Option(help="CSV t, cylinder_angle, guide_z, published as rig/joint_states, too."),
    ] = None,
    rate: Annotated[float, typer.Option(help="Film seconds per second.")] = 1.0,
    fps: Fps = None,
    encoding: Annotated[
        str, typer.Option(help="Of the published pixels, such as bayer_rggb8; else the film's.")
    ] = "",
    compressed: Annotated[
        str, typer.Option(help="jpeg or png, on camera/image_raw/compressed; else raw.")
    ] = "",
    force: Annotated[
        bool, typer.Option("--force", help="Publish although the topics have publishers.")
    ] = False,
    namespace: Namespace = "winding",
    domain: Domain = None,
) -> None:
    """Publish a film as a camera's driver does: frames with their stamps and their rhythm.

    Every frame has its camera_info. Frames that come late are counted and named.
    """
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.frame_sources import FrameSource, Recording, is_bag, read_bag
    from marker_tracker_node.camera.image_formats import COMPRESSIONS
    from marker_tracker_node.camera.recordings import read_motion
    from winding_cli.offline.played_film import Delivery, Played, due_messages
    from winding_cli.offline.played_film import play as publish_film
    from winding_recorder.bags.description import BagError
    from winding_recorder.playback.publishers import drain, refuse_rivals, wait_for_subscribers
    from winding_ros.topics import CAMERA_INFO, JOINT_STATES

    if not film.exists():
        refuse(f"{film} does not exist")
    if not 0.0 < rate < math.inf:
        refuse(f"--rate must be positive and finite, got {rate:g}")
    for option, word, known in (
        ("--encoding", encoding, tuple(ENCODINGS)),
        ("--compressed", compressed, COMPRESSIONS),
    ):
        if word and word not in known:
            refuse(f"{option} must be one of {', '.join(known)}, got {word!r}")
    check_namespace(namespace)
    delivery, played = Delivery(encoding=encoding, compression=compressed), Played(rate=rate)
    with refused(OSError, ValueError):
        brought = read_bag(film) if is_bag(film) else Recording(camera=None, motion=None)
        lens = read_camera(camera_file) if camera_file else brought.camera
        if lens is None:
            refuse("there is no camera: give --camera")
        readings = read_motion(motion) if motion else None
        pictures = FrameSource(film, fps=fps).pictures()
        first = next(pictures, None)
        if first is None:
            refuse(f"{film} holds no picture")
        delivery.of(first[1])
    messages = due_messages(chain([first], pictures), lens, readings, delivery)
    used = (CAMERA_INFO, delivery.topic, *((JOINT_STATES,) if readings else ()))
    try:
        with joined(domain), plain_node("film_player", namespace) as (node, _):
            if not force:
                refuse_rivals(node, [node.resolve_topic_name(topic.name) for topic in used])
            publishers = {topic: topic.advertise(node) for topic in used}
            wait_for_subscribers(node, publishers.values())
            publish_film(messages, lambda topic, data: publishers[topic].publish(data), played)
            drain(publishers.values())
    except (BagError, ValueError) as error:
        refuse(error, FAILED)
    except KeyboardInterrupt:
        print(played.sentence)
        end()
    print(played.sentence)


@with_options(Condition, MarkerParameters, CameraPlacement, CameraPixels)
def check_film(
    typed: Typed,
    markers: Typed,
    placement: Typed,
    pixels: Typed,
    *,
    film: Film,
    camera_file: CameraFile = None,
    exposure_ms: Annotated[
        float | None, typer.Option(min=1.0e-3, help="Exposure that the camera is set to.")
    ] = None,
    fps: Fps = None,
) -> None:
    """Judge exposure, gain and light by the pictures; exit 1 where something is to be changed.

    With a camera file, how far markers move during the exposure is known as well.
    """
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.frame_sources import FrameSource, is_bag, read_bag
    from marker_tracker_node.camera.image_formats import PixelReader
    from marker_tracker_node.detection.exposure_advice import (
        exposure_advice,
        marker_speed,
        picture_levels,
    )

    if not film.exists():
        refuse(f"{film} does not exist")
    with refused(OSError, ValueError):
        wound = Condition.from_typed(typed, spelling=spelled, case=Condition.case).resolved()
        look = typed_record(MarkerParameters, markers, spelled)
        read = typed_record(CameraPixels, pixels, spelled)
        lens = read_camera(camera_file) if camera_file else None
        if lens is None and is_bag(film):
            lens = read_bag(film).camera
        speed = math.nan
        if lens is not None:
            outside = wound.case.cylinder_radius + 2.0 * wound.case.cable_radius
            distance = typed_record(CameraPlacement, placement, spelled).camera_position[0]
            speed = marker_speed(lens, distance, outside, wound.drive.angular_speed)
        reader = PixelReader(encoding=read.encoding, significant_bits=read.significant_bits)
        frames = FrameSource(film, fps=fps, reader=reader)
        shown = (frame for _, frame in islice(frames, _CHECKED))
        with busy("looking at frames"):
            levels = picture_levels(
                shown, look.hues or (look.marker_hue,), look.marker_hue_tolerance
            )
    exposure = math.nan if exposure_ms is None else exposure_ms * MILLISECOND
    advice = exposure_advice(levels, exposure=exposure, speed=speed)
    for sentence in (*frames.remarks(), *advice.sentences):
        print(sentence)
    if advice.fault:
        raise typer.Exit(FAILED)
