"""Black boxes that count from another GO than the fleet's first one."""

from coordinator.log.box_file import box_text, start_of_box

SECOND = 1_000_000_000
BOX = (
    "t,x,y,heading,s,phase,estimate\n0.5,1.0,2.0,0.0,0.0,done,0.4\n1.5,1.0,2.0,0.0,0.0,done,\n2.5,1"
)


def a_box(folder, start=None):
    path = folder / "R9.csv"
    path.write_text(BOX)
    if start is not None:
        (folder / "R9.csv.start").write_text(start)
    return path


def test_the_times_of_a_late_box_are_moved_and_those_of_others_are_not(tmp_path):
    path = a_box(tmp_path, f"77 {12 * SECOND}\n")
    assert start_of_box(path) == 12 * SECOND
    rows = [line.split(",") for line in box_text(path, 2 * SECOND).splitlines()]
    assert [row[0] for row in rows] == ["t", "10.500000", "11.500000", "12.500000"]
    assert [row[6:] for row in rows] == [["estimate"], ["10.400000"], [""], []]
    assert [row[1:6] for row in rows[:3]] == [line.split(",")[1:6] for line in BOX.splitlines()[:3]]
    assert not box_text(path, 2 * SECOND).endswith("\n")
    assert box_text(path, 12 * SECOND) == BOX
    assert box_text(path, None) == BOX


def test_a_box_whose_start_is_not_known_stays_as_it_is(tmp_path):
    path = a_box(tmp_path)
    assert start_of_box(path) is None
    assert box_text(path, 2 * SECOND) == BOX
    for start in ("", "no number\n", "\xff"):
        a_box(tmp_path, start)
        assert box_text(path, 2 * SECOND) == BOX
