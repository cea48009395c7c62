"""A node that takes longer over one of its topics: slowed_node.py PACKAGE TOPIC SECONDS ..."""

import importlib
import sys
import time
from typing import Any

from winding_ros.graph import GRAPH


def main() -> int:
    _, package, name, seconds, *arguments = sys.argv
    sys.argv = [package, *arguments]
    spec = next(spec for spec in GRAPH if spec.package == package)
    handler: Any = getattr(
        importlib.import_module(f"{package}.ros.message_handler"), spec.handler_class
    )
    take = handler.take

    def slowly(self: Any, topic: Any, data: bytes) -> Any:
        if topic.name == name:
            time.sleep(float(seconds))
        yield from take(self, topic, data)

    handler.take = slowly
    return importlib.import_module(f"{package}.__main__").main()


if __name__ == "__main__":
    sys.exit(main())
