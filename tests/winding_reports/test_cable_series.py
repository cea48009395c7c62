"""The cable over time as files, read back by readers that share no code with the writers."""

import base64
import struct
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyarrow.csv
import pytest
from in_process import winding

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_reports.records.cable_series import CableSampler

DURATION = 3.0
PICTURES = 4
RUN = PlannedRun(config=WindingConfig(case=paper_case(4)), duration=DURATION)
FIELDS = {"s": "s_m", "tension": "tension_n", "strain": "strain", "twist": "twist_rad_m"}
ROUNDING = 1.0e-9  # Ten digits of numbers up to 4


class Kept:
    def __init__(self) -> None:
        self.cables: list[tuple[float, np.ndarray]] = []

    def add(self, t: float, cable: np.ndarray) -> None:
        self.cables.append((t, cable))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cable")
    winding(
        folder, "predict", "--case", 4, "--duration-s", DURATION, "--pictures", PICTURES,
        "--csv", "path.csv", "--vtk", "path.pvd", code=0,
    )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def wound() -> list[tuple[float, np.ndarray]]:
    kept = Kept()
    RUN.wind(whole=False, look=CableSampler([kept], RUN.frame_times(), PICTURES).look)
    return kept.cables


def array(element: ElementTree.Element) -> np.ndarray:
    """Return the numbers of a DataArray: base64 of zlib blocks behind a header of sizes."""
    kinds = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1"}
    text = "".join((element.text or "").split())
    (blocks,) = struct.unpack("<I", base64.b64decode(text[:8])[:4])
    header = 4 * (-(-4 * (3 + blocks) // 3))
    sizes = struct.unpack(f"<{3 + blocks}I", base64.b64decode(text[:header])[: 4 * (3 + blocks)])
    data = base64.b64decode(text[header:])
    parts, begin = [], 0
    for size in sizes[3:]:
        parts.append(zlib.decompress(data[begin : begin + size]))
        begin += size
    return np.frombuffer(b"".join(parts), kinds[element.attrib["type"]])


def vtk_arrays(file: Path) -> dict[str, np.ndarray]:
    root = ElementTree.parse(file).getroot()
    assert root.attrib["byte_order"] == "LittleEndian"
    return {item.attrib["Name"]: array(item) for item in root.iter("DataArray")}


def test_series_names_a_file_for_every_time(written: Path) -> None:
    sets = list(ElementTree.parse(written / "path.pvd").getroot().iter("DataSet"))
    assert [float(item.attrib["timestep"]) for item in sets] == [0.0, 1.0, 2.0, 3.0]
    files = [written / item.attrib["file"] for item in sets]
    assert sorted((written / "path").iterdir()) == files


def test_vtk_holds_path_tension_and_twist(written: Path, wound: list) -> None:
    assert wound
    for i, (_, cable) in enumerate(wound):
        arrays = vtk_arrays(written / "path" / f"cable_{i:05d}.vtu")
        points = arrays["Points"].reshape(-1, 3)
        for column, name in enumerate("xyz"):
            np.testing.assert_array_equal(points[:, column], cable[name])
        for name in FIELDS:
            np.testing.assert_array_equal(arrays[name], cable[name])
        ends = arrays["connectivity"].reshape(-1, 2)
        np.testing.assert_array_equal(ends[:, 1] - ends[:, 0], 1)
        assert ends.shape[0] == cable.size - 1
        # 3 is VTK's line of two points.
        assert set(arrays["types"].tolist()) == {3}


def test_table_holds_path_tension_and_twist(written: Path, wound: list) -> None:
    table = pyarrow.csv.read_csv(written / "path.csv").to_pydict()
    times = np.array(table["t_s"])
    for t, cable in wound:
        rows = times == t
        assert np.array(table["node"])[rows].tolist() == list(range(cable.size))
        for name in "xyz":
            np.testing.assert_allclose(
                np.array(table[f"{name}_m"])[rows], cable[name], rtol=ROUNDING, atol=ROUNDING
            )
        for name, column in FIELDS.items():
            np.testing.assert_allclose(
                np.array(table[column])[rows], cable[name], rtol=ROUNDING, atol=ROUNDING
            )
    assert times.size == sum(cable.size for _, cable in wound)


def test_twist_of_cable_that_does_not_roll_is_the_torsion_of_its_helix() -> None:
    model = RodWinding(RUN.config)
    for i in range(1, 101):
        model.advance_to(0.1 * i, RUN.drive.reading_at(0.1 * i))
    cable = model.cable()
    theta, z = model.wound_path()[1:]
    # Cable in the second turn, where the lay is steady: torsion slope / (slope^2 + rho^2), turned
    # against the cable's own direction.
    turn = (theta > 6.3) & (theta < 12.6)
    slope = np.polyfit(theta[turn], z[turn], 1)[0]
    rho = RUN.config.case.centreline_radius
    helix = -slope / (slope**2 + rho**2)
    # The pitch still rises by a tenth within the turn.
    assert cable["twist"][: theta.size][turn].mean() == pytest.approx(helix, rel=0.02)
    # The eye lets the span turn as it likes.
    np.testing.assert_array_equal(cable["twist"][theta.size + 1 :], 0.0)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--vtk", "path.vtu"], "--vtk needs a file whose name ends in .pvd, got path.vtu"),
        (["--element", "solid", "--csv", "path.csv"], "--csv and --vtk tell of a rod"),
        (["--csv", "nowhere/path.csv"], "there is no folder nowhere for path.csv"),
    ],
)
def test_unwritable_series_are_refused(options: list[str], sentence: str, tmp_path: Path) -> None:
    assert sentence in winding(tmp_path, "predict", "--case", 4, *options, code=2).output
    assert not list(tmp_path.iterdir())
