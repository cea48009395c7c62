"""Wrong cell files, each made from a valid one by one change, with the line where it is wrong."""

from collections.abc import Iterator
from typing import NamedTuple

from winding_core.parameters import Declaration, typed_declaration
from winding_core.run_spec import OPTIONS

VALID = """\
condition:
  case: 7
  young_mpa: 3.1
  law: neo_hookean
  duration_s: 1.5
machine:
  speed: 0
  lay: fem
  seed: 11
camera:
  frame_rate: 1000
  camera_noise: 0.5
  camera_clock_correction: true
  camera_position_mm: [430, 1.5, 52.0]
tracking:
  band_mm: 7
  marker_colours: red,yellow
lay:
  control: watch
  pitch_mm: 17.5
limits:
  lay_tolerance_mm: 0.75
  error_limit_pct: 6.5
recording:
  output: left
  compression: zstd
graph:
  namespace: left/cell
"""
LINES = VALID.splitlines()


class Wrong(NamedTuple):
    name: str
    content: bytes
    line: int  # Where it is wrong; a refusal names it
    words: str = ""  # Of the sentence


def changed(number: int, *lines: str) -> str:
    """Return the valid file with other lines in place of one, counted from 1."""
    return "\n".join([*LINES[: number - 1], *lines, *LINES[number:]]) + "\n"


def options_of_file() -> Iterator[tuple[int, str, str, str, Declaration]]:
    """Yield line, section, option, value and declaration."""
    section = ""
    for number, line in enumerate(LINES, 1):
        key, _, value = line.strip().partition(":")
        if not line.startswith(" "):
            section = key
        else:
            yield number, section, key, value.strip(), OPTIONS[section][key]


def of_values() -> Iterator[Wrong]:
    """Yield files with a value that its option does not take; a schema can refuse them."""
    for number, _, key, value, item in options_of_file():
        for kind, wrong in wrong_values(key, value, item):
            yield Wrong(f"{key} {kind}", changed(number, f"  {key}: {wrong}").encode(), number, key)


def wrong_values(key: str, value: str, item: Declaration) -> Iterator[tuple[str, str]]:
    typed, default = typed_declaration(key, item), item.default
    if isinstance(default, str):
        yield "number", "12"
        if item.choices:
            yield "choice", f"{value}x"
    elif isinstance(default, bool):
        yield "number", "1"
        yield "text", '"true"'
    elif isinstance(default, list):
        yield "short", "[1, 2]"
        yield "nan", "[1, .nan, 3]"
    else:
        yield "quoted", f'"{value}"'
        yield "truth", "true"
        yield "infinite", "-.inf"
        if typed.low is not None:
            yield "low", f"{int(typed.low) - 3}"
        if typed.high is not None:
            yield "high", f"{int(typed.high) + 7}"


def of_structure() -> Iterator[Wrong]:
    """Yield files whose names or nesting are wrong."""
    for number, section, key, value, _ in options_of_file():
        misspelt = key[0] + key
        yield Wrong(
            f"{key} misspelt", changed(number, f"  {misspelt}: {value}").encode(), number,
            f"did you mean {key}?",
        )  # fmt: skip
        elsewhere = "page" if section != "page" else "graph"
        moved = VALID.replace(LINES[number - 1], "  # moved", 1)
        yield Wrong(
            f"{key} elsewhere", f"{moved}{elsewhere}:\n  {key}: {value}\n".encode(),
            len(LINES) + 2, f"{key} belongs below {section}",
        )  # fmt: skip
    yield Wrong("outdented", changed(9, "seed: 11").encode(), 9, "seed belongs below machine")
    yield Wrong("indented", changed(15, "  tracking:").encode(), 15, "section of its own")
    yield Wrong("nested", changed(3, "  young_mpa: {value: 3}").encode(), 3, "takes a value")
    yield Wrong("section of a number", f"{VALID}page: 3\n".encode(), 29, "mapping")
    yield Wrong("sections in a list", b"- condition\n- machine\n", 1, "mapping")
    yield Wrong("unknown section", changed(15, "trakcing:").encode(), 15, "did you mean tracking?")
    yield Wrong("nothing", changed(8, "  lay:").encode(), 8, "lay has no value")
    yield Wrong("twice", changed(9, LINES[8], "  seed: 12").encode(), 10, "line 9 already")
    yield Wrong("section twice", f"{VALID}lay:\n  brake: true\n".encode(), 29, "line 18 already")


def of_text() -> Iterator[Wrong]:
    """Yield files that are no plain YAML."""
    yield Wrong("bracket", changed(14, "  camera_position_mm: [1, 2").encode(), 15)
    yield Wrong("quote", changed(4, '  law: "linear').encode(), 29, "begun in line 4")
    yield Wrong("tab", changed(9, "\tseed: 11").encode(), 9)
    yield Wrong("colons", changed(5, "  duration_s: 1: 2").encode(), 5)
    yield Wrong("latin", changed(4, "  law: hypér").encode("latin-1"), 4, "UTF-8")
    yield Wrong("control", changed(4, "  law: a\x07").encode(), 4, "character")
    yield Wrong("escape", changed(4, r'  law: "\UFFFFFFFF"').encode(), 4)
    yield Wrong("line feed", changed(25, r'  output: "a\nb"').encode(), 25, "character")
    yield Wrong("anchor", changed(2, "  case: &n 7").encode(), 2, "anchors")
    yield Wrong("alias", changed(9, "  seed: *n").encode(), 9, "anchors")
    yield Wrong("tag", changed(9, "  seed: !!python/name:os.system").encode(), 9, "tags")
    yield Wrong("merge", changed(9, "  <<: {seed: 3}").encode(), 9, "'<<'")
    yield Wrong("deep", changed(9, f"  seed: {'[' * 9000}").encode(), 9, "nested too deeply")
    yield Wrong("digits", changed(9, f"  seed: {'9' * 5000}").encode(), 9, "5000 digits")
    yield Wrong("two documents", f"{VALID}---\ncondition: {{}}\n".encode(), 29)
    yield Wrong("long", VALID.encode() + b"#" * 1_000_001, 1, "at most 1000000 bytes")


def of_meaning() -> Iterator[Wrong]:
    """Yield files of right names and types that no run can be."""

    def wrong(line: int, text: str, words: str) -> Wrong:
        return Wrong(text.strip(), changed(line, *text.splitlines()).encode(), line, words)

    both = changed(5, "  free_length_mm: 150", "  guide_distance_mm: 160")
    yield Wrong("two spans", both.encode(), 1, "guide_distance_mm (line 6) or free_length_mm (line")
    driver = changed(7, "  machine: external")
    yield Wrong("driver", driver.encode(), 8, "lay (line 8) is for the simulated machine")
    yield wrong(2, "  case: 13", "case must be one of 1 to 12, got 13")
    yield wrong(5, "  guide_distance_mm: 12", "must exceed the centreline radius")
    yield wrong(3, "  prony: 0.2", "prony")
    yield wrong(8, "  lay: silk", "lay must be one of paper, fem, driven")
    yield wrong(8, "  lay: paper", "is what the paper measured")
    yield wrong(7, "  turns: 4", "turns (line 7) is for an external machine")
    yield wrong(11, "  frame_rate: 400", "must be 200 or 1000, got 400")
    yield wrong(11, "  camera: false", "the simulated machine has a camera")
    yield wrong(12, "  row_time_us: 4", "for the pictures of a real camera")
    yield wrong(12, "  compose: my_camera:open", "has a camera of its own")
    yield wrong(17, "  marker_colours: pink", "must list red")
    yield wrong(20, "  program: nowhere.csv", "nowhere.csv")
    marked = changed(20, "  markers_every_turn: true").encode()
    yield Wrong("no brake", marked, 18, "needs a brake")
    yield wrong(25, "  output: taken", "taken exists already")
    yield wrong(26, "  bag: taken", "taken exists already")
    yield wrong(26, "  json: taken", "taken is a folder, not a file")
    yield wrong(28, "  namespace: a b", "namespace must be made of letters")
    yield wrong(28, "  parameters: absent.yaml", "there is no file absent.yaml")
    yield wrong(27, "correction: {weights: nowhere}\ngraph:", "no trained weights at nowhere")
    yield wrong(27, "page: {dashboard_port: 8090}\ngraph:", "is for a run with dashboard")


def all_of_them() -> list[Wrong]:
    return [*of_values(), *of_structure(), *of_text(), *of_meaning()]
