import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.base.errors import InputError
from coordinator.scenario_files.maps.floor_map import MapOptions
from coordinator.scenario_files.maps.map_reader import read_map

GOOD = b"type octile\nheight 3\nwidth 4\nmap\n.G@O\nTWS.\n....\n"


@pytest.fixture
def write(tmp_path):
    def write_map(text, **options):
        (tmp_path / "a.map").write_bytes(text)
        return read_map(tmp_path / "a.map", MapOptions(**options))

    return write_map


def problems_of(write, text, **options):
    with pytest.raises(InputError) as caught:
        write(text, **options)
    assert all(problem.isprintable() for problem in caught.value.problems)
    return caught.value.problems


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_trees_water_and_bounds_block_and_swamp_does_not(write, end):
    floor = write(GOOD.replace(b"\n", end).rstrip(), cell=0.5)
    area = shapely.union_all([shapely.Polygon(corners) for corners in floor.obstacles])
    for row, line in enumerate([".G@O", "TWS.", "...."]):
        for column, char in enumerate(line):
            centre = shapely.Point(0.5 * column + 0.25, 1.5 - 0.5 * row - 0.25)
            assert area.covers(centre) == (char in "@OTW")
    assert floor.boundary == ((0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (0.0, 1.5))
    assert floor.note == (
        "map a.map: 4 x 3 cells of 0.5 m, 2 obstacles with 8 corners, nothing uncovered, none added"
    )


def test_cells_are_one_metre_wide_unless_told(write):
    assert write(GOOD).boundary[2] == (4.0, 3.0)


FAULTS = {
    "no type": (b"octile", b"type octile", "line 1: 'octile' is not 'type octile'"),
    "no height": (b"high 3", b"height 3", "line 2: 'high 3' is not 'height N'"),
    "a negative width": (b"width -4", b"width 4", "line 3: 'width -4' is not 'width N'"),
    "no map": (b"mop\n", b"map\n", "line 4: 'mop' is not 'map'"),
    "no rows": (b"height 0", b"height 3", "line 2: 4 x 0 cells are not a map"),
    "too many cells": (
        b"height 9999999",
        b"height 3",
        "line 2: 4 x 9999999 cells are more than 16777216",
    ),
    "a strange cell": (b"TWx.", b"TWS.", "line 6, column 3: 'x' is not one of . G S @ O T W"),
    "a short row": (b"TWS\n", b"TWS.\n", "line 6: 3 cells, but the width is 4"),
    "a long row": (b"TWS..\n", b"TWS.\n", "line 6: 5 cells, but the width is 4"),
    "a row too few": (b"\n\n", b"\n....\n", "line 7: 0 cells, but the width is 4"),
    "a file cut off": (b"TWS.", b"TWS.\n....\n", "line 6: the file ends after 2 of 3 rows"),
    "a row too many": (b"....\n..@\n", b"....\n", "line 8: '..@' comes after the last row"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_told_with_its_line(write, name):
    put, gone, sentence = FAULTS[name]
    assert problems_of(write, GOOD.replace(gone, put)) == (f"a.map: {sentence}",)


def test_many_faults_are_told_and_endless_ones_are_counted(write):
    assert len(problems_of(write, GOOD.replace(b"map\n.G", b"map\nxy").replace(b"WS", b"??"))) == 4
    text = b"type octile\nheight 1\nwidth 1000\nmap\n" + b"x" * 1000
    *_, last = problems_of(write, text)
    assert last == "a.map: and 980 more faults of this kind"


def test_a_map_wider_than_any_floor_is_refused(write):
    (problem,) = problems_of(write, GOOD, cell=50_000.0)
    assert "200000 m wide" in problem


@settings(derandomize=True, max_examples=60, deadline=None)
@given(at=st.integers(0, len(GOOD)), gone=st.integers(0, 9), put=st.binary(max_size=9))
def test_damaged_bytes_are_read_or_refused(tmp_path_factory, at, gone, put):
    path = tmp_path_factory.getbasetemp() / "damaged.map"
    problems = []
    for text in (GOOD[:at] + put + GOOD[at + gone :], put, GOOD[:at]):
        path.write_bytes(text)
        try:
            assert read_map(path).boundary
        except InputError as error:
            problems += error.problems
    assert all(problem.isprintable() for problem in problems)
