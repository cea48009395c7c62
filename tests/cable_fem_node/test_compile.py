"""Cached machine code never outlives the sources that it was built from."""

from __future__ import annotations

import os

from cable_fem_node.dynamics.compile import drop_stale_code


def test_only_code_older_than_a_source_is_dropped(tmp_path):
    cache = tmp_path / "__pycache__"
    cache.mkdir()
    source, old, new = tmp_path / "law.py", cache / "old.nbi", cache / "new.nbc"
    for path, age in ((source, 100.0), (old, 200.0), (new, 50.0)):
        path.touch()
        stamp = path.stat().st_mtime - age
        os.utime(path, (stamp, stamp))
    drop_stale_code(tmp_path)
    assert not old.exists()
    assert new.exists()
