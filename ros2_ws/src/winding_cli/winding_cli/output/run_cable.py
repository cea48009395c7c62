"""The cable of a run at its end, from what the solver published."""

from __future__ import annotations

from functools import partial

import numpy as np

from winding_core.cases import Case
from winding_core.markers import CABLE_DTYPE, MARKER_DTYPE, is_wound
from winding_recorder.live.run_buffer import RunBuffer
from winding_reports.records.run_record import WoundCable
from winding_ros import topics
from winding_ros.cloud_messages import decode_cloud
from winding_study.paper.case_result import MOST_NODES


def last_cable(buffer: RunBuffer, case: Case) -> WoundCable | None:
    """Return the cable as the solver published it last; None where it published none.

    Of a long run that is the span and the newest turns.
    """
    cable = buffer.newest(topics.FEM_CABLE, partial(decode_cloud, dtype=CABLE_DTYPE))
    markers = buffer.newest(topics.FEM_MARKERS, partial(decode_cloud, dtype=MARKER_DTYPE))
    if cable is None or len(cable[1]) < 2:
        return None
    records = cable[1]
    keep = np.unique(np.linspace(0, records.size - 1, min(records.size, MOST_NODES)).astype(int))
    whole = float(records["s"][0]) < float(records["s"][1] - records["s"][0])
    marks = {0: (0.0, 0.0)} if whole else {}
    if markers is not None and whole:
        wound = markers[1][is_wound(markers[1])]
        marks |= {int(m["id"]): (float(m["theta"]), float(m["z"])) for m in wound}
    return WoundCable(
        case=case,
        nodes=np.column_stack([records[axis][keep] for axis in "xyz"]).astype(float),
        strain=records["strain"][keep].astype(float),
        marks=marks,
    )
