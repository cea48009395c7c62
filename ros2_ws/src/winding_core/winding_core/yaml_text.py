"""YAML that a person gave, read so that no text can do more than be refused."""

from typing import Any

import yaml

MOST_CHARACTERS = 1_000_000  # Parameters, sweeps and cameras take a few kilobytes


class YamlTextError(ValueError):
    """A text is no YAML, or YAML of a kind that is not taken."""


class PlainLoader(yaml.SafeLoader):
    """YAML's safe loader without aliases, as rcl reads parameters.

    A text of a few lines whose aliases stand for each other unfolds to any size.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Return the next node.

        Raises:
            YAMLError: It is an alias, which stands for another.
        """
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.YAMLError(f"an alias stands in line {mark.line + 1}: write the value out")
        return super().compose_node(parent, index)


def load_yaml(text: str, loader: type[yaml.SafeLoader] = PlainLoader) -> Any:
    """Return what a YAML document holds: mappings, lists, numbers, texts.

    Raises:
        YamlTextError: Why it is refused, in one line.
    """
    if len(text) > MOST_CHARACTERS:
        raise YamlTextError(f"it has {len(text)} characters, more than {MOST_CHARACTERS}")
    try:
        return yaml.load(text, loader)
    except yaml.YAMLError as error:
        raise YamlTextError(" ".join(str(error).split())) from error
    except RecursionError as error:
        raise YamlTextError("it is nested too deeply") from error
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        # Values with an explicit tag, such as !!int, raise whatever their text runs into.
        raise YamlTextError(
            f"a value does not fit its tag: {' '.join(str(error).split())}"
        ) from error
