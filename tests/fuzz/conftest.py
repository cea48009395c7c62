"""Profiles of the made-up inputs: the same ones every time, and more and others on request.

FUZZ_TIMES=10 tries ten times as many, not the same ones each time.
"""

import os

from hypothesis import HealthCheck, settings

_TIMES = int(os.environ.get("FUZZ_TIMES", "1"))


def _register(name: str, examples: int) -> None:
    settings.register_profile(
        name,
        max_examples=examples * _TIMES,
        derandomize=_TIMES == 1,
        database=None,
        deadline=None,
        # Examples share a folder of their test; they clean it themselves.
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )


_register("quick", 60)
# One example opens files, or measures a picture.
_register("files", 10)
