"""Motions side by side: the kernels read from them what each motion says itself."""

import math

import numpy as np
import pytest

from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.schedule.forbidden_interval_kernels import first_at, last_at, reached
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import alone, fleet_on, placed


@pytest.mark.parametrize("accel", [0.7, math.inf])
def test_a_table_of_motions_tells_the_times_of_each(accel):
    curves = [
        line((0, 2), (12, 2)),
        line((3, 0), (3, 4), (9, 4), (9, 0)),
        line((0, 2), (6, 2)),
        line((3, 0), (3, 6)),
    ]
    fleet = fleet_on(curves, [0.4, 1.0, 0.7, 0.9], accel=accel)
    limits = [track.limits for track in fleet.junctions.tracks]
    many = [Wait(0.25 * (k + 1), 3.0 * k, -1) for k in range(40)]
    motions = [
        Motion(limits[0], many),
        Motion(limits[1], []),
        None,
        alone(fleet.junctions.tracks[3]),
    ]
    table = placed(fleet, motions)
    table.put(1, Motion(limits[1], many[:9]))
    table.put(3, None)
    motions[1], motions[3] = Motion(limits[1], many[:9]), None
    assert table.placed.tolist() == [True, True, False, False]
    assert len(set(table.table.serial.tolist())) == 4
    for index in (0, 1):
        s = np.array([0.0, 0.25, 0.251, 0.5, 1.0, 3.7, curves[index].length])
        assert [reached(table.table, index, x) for x in s] == pytest.approx(
            motions[index].reached(s)
        )
        for leg in range(table.table.knots[index] - 1):
            for tell, wanted in (
                (first_at, motions[index].reached),
                (last_at, motions[index].left),
            ):
                times = [tell(table.table, index, x, leg)[0] for x in s]
                assert times == pytest.approx(wanted(s))
    with pytest.raises(ValueError, match="2 robots have no motion"):
        table.all()
