"""Black boxes that count from another GO than the fleet's first one."""

from coordinator.log.box_file import box_text, boxes_of_run, start_of_box

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


def parts(folder, **texts):
    """Write the files of R9's box, each with a start, and return the newest one."""
    for name, (start, *times) in texts.items():
        path = folder / f"R9.csv{name.replace('part', '.').removeprefix('now')}"
        path.write_text("t,x\n" + "".join(f"{t},1\n" for t in times))
        path.with_name(f"{path.name}.start").write_text(f"7 {start}")
    return folder / "R9.csv"


def test_what_earlier_programs_kept_of_the_same_run_comes_first(tmp_path):
    path = parts(
        tmp_path,
        part1=(5 * SECOND, 0.5, 1.5),
        part2=(5 * SECOND, 2.5),
        part3=(99 * SECOND, 0.1),
        now=(6 * SECOND, 4.5),
    )
    *earlier, newest = boxes_of_run(path, {5 * SECOND, 6 * SECOND})
    assert [one.name for one in earlier] == ["R9.csv.1", "R9.csv.2"]
    assert newest == path
    rows = box_text(newest, 5 * SECOND, earlier).split()
    assert rows == ["t,x", "0.5,1", "1.5,1", "2.5,1", "5.500000,1"]


def test_the_newest_file_of_the_run_counts_though_a_later_run_has_its_name(tmp_path):
    path = parts(tmp_path, part1=(5 * SECOND, 0.5), now=(99 * SECOND, 0.5))
    assert [one.name for one in boxes_of_run(path, {5 * SECOND})] == ["R9.csv.1"]
    assert boxes_of_run(path, {6 * SECOND}) == []
    assert boxes_of_run(path, ()) == [path]


def test_an_earlier_file_with_a_cut_row_or_other_columns_or_later_times_spoils_nothing(tmp_path):
    path = parts(tmp_path, part1=(5, 0.5, 1.5), now=(5, 4.5))
    earlier = tmp_path / "R9.csv.1"
    earlier.write_text(earlier.read_text() + "2.5")
    assert box_text(path, None, [earlier]).split() == ["t,x", "0.5,1", "1.5,1", "4.5,1"]
    for text in ("t,y\n0.5,1\n", "t,x\n7.5,1\n"):
        earlier.write_text(text)
        assert box_text(path, None, [earlier]) == path.read_text()
