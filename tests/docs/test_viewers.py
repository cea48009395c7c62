"""The viewers' layouts show topics that the graph has, in a frame that its messages carry."""

import json
import re
from importlib.resources import files

import yaml

from winding_ros import topics
from winding_ros.graph import DEFAULT_NAMESPACE
from winding_ros.messages.rig import BASE_FRAME

FOLDER = files("winding_bringup") / "viewers"
NAMES = {
    topic.name if topic.name.startswith("/") else f"/{DEFAULT_NAMESPACE}/{topic.name}"
    for topic in topics.TOPICS
}


def test_every_topic_of_a_layout_exists() -> None:
    for name in ("winding.rviz", "foxglove_layout.json"):
        text = (FOLDER / name).read_text(encoding="utf-8")
        shown = set(re.findall(rf"/{DEFAULT_NAMESPACE}/[a-z_/]+", text))
        assert shown
        assert shown <= NAMES, name


def test_rviz_shows_the_frame_of_the_messages() -> None:
    layout = yaml.safe_load((FOLDER / "winding.rviz").read_text(encoding="utf-8"))
    assert layout["Visualization Manager"]["Global Options"]["Fixed Frame"] == BASE_FRAME


def test_every_panel_of_the_foxglove_layout_is_configured() -> None:
    layout = json.loads((FOLDER / "foxglove_layout.json").read_text(encoding="utf-8"))

    def panels(node: object) -> set[str]:
        if isinstance(node, dict):
            return panels(node["first"]) | panels(node["second"])
        return {str(node)}

    assert panels(layout["layout"]) == set(layout["configById"])
