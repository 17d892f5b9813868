"""The file for viewers, read by the descriptors in it and held against plan and robot."""

import dataclasses
import io
import math
import random

import numpy as np
import pytest
import shapely
from foxglove.messages import SceneUpdate, Timestamp
from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader
from msgspec.structs import replace
from zstandard import ZstdError

from coordinator.base.errors import InputError
from coordinator.exchange.foxglove import write_scene
from coordinator.exchange.foxglove_scene import floor_entities
from coordinator.exchange.motion_story import csv_lines, story_of_plan
from coordinator.findings.info_fields import FaultSummary
from coordinator.plan import trajectory
from coordinator.plan.document import Floor
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import drive
from tests.coordinator.findings.two_epochs import (
    BEGIN,
    FREEZE_1,
    GO_1,
    GO_2,
    SECOND,
    WALL,
    RobotsOwn,
)
from tests.foxglove_file import message_class, messages_of
from tests.oracles import tracks

ZERO = WALL + BEGIN + round(GO_1 * SECOND)
"""Time zero of the log's story: GO of its first epoch [ns]."""

SCHEMAS = {
    "/tf": "foxglove.FrameTransforms",
    "/floor": "foxglove.SceneUpdate",
    "/robots": "foxglove.SceneUpdate",
    "/paths": "foxglove.SceneUpdate",
    "/zones": "foxglove.SceneUpdate",
    "/points/floor": "foxglove.PointCloud",
    "/points/paths": "foxglove.PointCloud",
    "/points/robots/R1": "foxglove.PointCloud",
    "/points/robots/R2": "foxglove.PointCloud",
}


def on(topic, found):
    return [(one.log_time, one.message) for one in found if one.topic == topic]


def poses_of(robot, found):
    """Log times [ns] and x, y, heading (n, 3) of a robot's frame."""
    times, poses = [], []
    for at, message in on("/tf", found):
        (one,) = (each for each in message.transforms if each.child_frame_id == f"robot/{robot}")
        place, turn = one.translation, one.rotation
        assert one.parent_frame_id == "floor"
        assert (place.z, turn.x, turn.y) == (0.0, 0.0, 0.0)
        assert math.hypot(turn.z, turn.w) == pytest.approx(1.0, abs=1e-12)
        times.append(at)
        poses.append((place.x, place.y, 2.0 * math.atan2(turn.z, turn.w)))
    return np.array(times), np.array(poses)


def points_of(cloud):
    """Places (n, 2) [m] and colours (n, 4) of a cloud, by the fields that it says it has."""
    kinds = {1: "u1", 7: "<f4"}
    fields = cloud.fields
    layout = {
        "names": [field.name for field in fields],
        "formats": [kinds[field.type] for field in fields],
        "offsets": [field.offset for field in fields],
        "itemsize": cloud.point_stride,
    }
    points = np.frombuffer(cloud.data, np.dtype(layout))
    assert not points["z"].any()
    assert cloud.pose.orientation.w == 1.0
    colours = [points[name] for name in ("red", "green", "blue", "alpha")]
    return np.column_stack((points["x"], points["y"])).astype(float), np.column_stack(colours)


def alike(poses, wanted):
    assert poses[:, :2] == pytest.approx(wanted[:, :2], abs=1e-6)
    turned = np.remainder(poses[:, 2] - wanted[:, 2] + math.pi, math.tau) - math.pi
    assert turned == pytest.approx(np.zeros(len(turned)), abs=1e-6)


def test_every_topic_has_foxgloves_schema_and_every_stamp_is_the_log_time(story, document):
    for told in (story, story_of_plan(document)):
        found = messages_of(write_scene(told, 0.05))
        seen = {one.topic: one.schema for one in found}
        assert seen == SCHEMAS | ({"/log": "foxglove.Log"} if told is story else {})
        assert [one.log_time for one in found] == sorted(one.log_time for one in found)
        for one in found:
            assert one.log_time == one.publish_time
            fields = {field.name for field in one.message.DESCRIPTOR.fields}
            stamped = [one.message] if "timestamp" in fields else []
            for name in fields & {"entities", "deletions", "transforms"}:
                stamped += getattr(one.message, name)
            assert stamped
            for each in stamped:
                assert each.timestamp.ToNanoseconds() == one.log_time, one.topic


def test_the_same_story_gives_the_same_bytes(story):
    assert write_scene(story, 0.05) == write_scene(story, 0.05)


def test_a_byte_that_changes_anywhere_among_the_messages_is_seen(story):
    data = write_scene(story, 0.5)
    assert list(StreamReader(io.BytesIO(data), validate_crcs=True).records)
    for place in range(len(data) // 20, len(data) // 2, len(data) // 20):
        changed = bytearray(data)
        changed[place] ^= 1
        with pytest.raises((McapError, ZstdError, ValueError)):
            list(StreamReader(io.BytesIO(bytes(changed)), validate_crcs=True).records)


def test_a_plans_robots_are_where_the_plan_has_them_twenty_times_a_second(document):
    found = messages_of(write_scene(story_of_plan(document), 0.05))
    last = max(robot.finish_time for robot in document.robots)
    for driven, track in zip(drive(document), tracks(to_json(document)), strict=True):
        times, poses = poses_of(driven.id, found)
        assert len(times) == math.ceil(last / 0.05) + 1
        alike(poses, trajectory.sample(driven, (times / SECOND).tolist()))
        assert poses[:, :2] == pytest.approx(track.at(times / SECOND), abs=3e-4)


def test_a_logs_robots_are_where_their_plans_have_them_in_every_epoch(story, document, second):
    found = messages_of(write_scene(story, 0.05))
    one, two = drive(document)
    (later,) = drive(second)
    frozen = FREEZE_1 - GO_1
    times, poses = poses_of("R1", found)
    t = (times - ZERO) / SECOND
    assert len(t) == pytest.approx(30.1 * 20, abs=2)
    before, after = t <= frozen, t >= GO_2 - GO_1
    alike(poses[before], trajectory.sample(one, t[before].tolist()))
    alike(poses[after], trajectory.sample(later, (t[after] - (GO_2 - GO_1)).tolist()))
    own = RobotsOwn(document, document.robot("R1"))
    rest, slowing = own.rest(frozen)
    for moment, pose in zip(t, poses, strict=True):
        if frozen < moment < GO_2 - GO_1:
            left = max(frozen + slowing - moment, 0.0)
            own.curve.place(rest - 0.5 * own.rate * left**2)
            assert pose[:2] == pytest.approx((own.curve.x, own.curve.y), abs=1e-3)
    _, poses = poses_of("R2", found)  # killed, last heard at 3.5 s
    alike(poses, trajectory.sample(two, np.minimum(t, 3.5 - GO_1).tolist()))


def test_a_logs_robots_are_where_the_csv_has_them(story):
    times, poses = poses_of("R1", messages_of(write_scene(story, 0.5)))
    rows = [line.split(",") for line in csv_lines(story, 0.001) if line.startswith("R1,")]
    table = np.array([[float(cell) for cell in row[1:4]] for row in rows])
    for t, (x, y, _) in zip((times - ZERO) / SECOND, poses, strict=True):
        row = table[max(np.searchsorted(table[:, 0], t + 1e-9) - 1, 0)]
        assert (x, y) == pytest.approx(tuple(row[1:]), abs=1e-3)


def test_paths_go_when_their_epoch_is_over(story):
    found = messages_of(write_scene(story, 0.5))
    (_, first), (at, later) = on("/paths", found)
    assert {each.id for each in first.entities} == {"path/R1", "path/R2"}
    assert [(each.id, each.type) for each in later.deletions] == [("path/R2", 0)]
    assert (at - ZERO) / SECOND == pytest.approx(GO_2 - GO_1)
    assert [at for at, _ in on("/points/paths", found)] == [at for at, _ in on("/paths", found)]


def test_points_trace_the_paths_of_their_epoch_and_the_floor(story, document, second):
    found = messages_of(write_scene(story, 0.5))
    for plan, (_, cloud) in zip((document, second), on("/points/paths", found), strict=True):
        assert cloud.frame_id == "floor"
        places, colours = points_of(cloud)
        inks = np.unique(colours, axis=0)
        assert len(inks) == len(plan.robots)
        traced = np.zeros(len(places), bool)
        for track in tracks(to_json(plan)):
            line, goal = shapely.LineString(track.line), shapely.Point(track.line[-1])
            ring = goal.buffer(track.radius, quad_segs=64).exterior
            on_line = shapely.distance(line, shapely.points(places)) < 1e-5
            traced |= on_line | (shapely.distance(ring, shapely.points(places)) < 3e-5)
            along = np.sort(shapely.line_locate_point(line, shapely.points(places[on_line])))
            assert np.diff(along, prepend=0.0, append=line.length).max() < 0.051
        assert traced.all()
    ((_, cloud),) = on("/points/floor", found)
    outlines = [shapely.Polygon(ring).exterior for ring in document.workspace.obstacles]
    outlines.append(shapely.Polygon(document.workspace.boundary).exterior)
    drawn = shapely.MultiPoint(points_of(cloud)[0])
    assert shapely.distance(shapely.union_all(outlines), shapely.get_parts(drawn)).max() < 1e-6
    for outline in outlines:
        assert shapely.hausdorff_distance(drawn.intersection(outline.buffer(1e-6)), outline) < 0.03


def test_a_robots_points_are_its_outline_in_its_own_frame(story):
    found = messages_of(write_scene(story, 0.5))
    ((_, scene),) = on("/robots", found)
    for entity in scene.entities:
        name = entity.id.removeprefix("robot/")
        ((_, cloud),) = on(f"/points/robots/{name}", found)
        assert cloud.frame_id == entity.frame_id == f"robot/{name}"
        places, colours = points_of(cloud)
        paint = entity.cylinders[0].color
        wanted = [round(255 * share) for share in (paint.r, paint.g, paint.b, paint.a)]
        assert (colours == wanted).all()
        far = np.hypot(*places.T)
        assert far.max() == pytest.approx(0.5 * entity.cylinders[0].size.x, abs=1e-6)
        assert (np.isclose(far, far.max()) | ((places[:, 1] == 0.0) & (places[:, 0] >= 0.0))).all()


def test_zones_light_up_while_somebody_waits(document):
    (reason,) = document.waits
    zones = on("/zones", messages_of(write_scene(story_of_plan(document), 0.5)))
    lit = [(at / SECOND, message.entities[0]) for at, message in zones]
    assert [bool(entity.texts) for _, entity in lit] == [False, True, False]
    assert lit[1][1].texts[0].text == f"{reason.robot} waits for {reason.yields_to}"
    assert lit[2][0] - lit[1][0] == pytest.approx(reason.wait, abs=1e-6)


def test_what_happened_is_in_the_log_of_the_viewer_with_its_level(story):
    found = on("/log", messages_of(write_scene(story, 0.5)))
    lines = [(at - WALL - BEGIN, line.level, line.message, line.name) for at, line in found]
    frozen = (round(FREEZE_1 * SECOND), 3, "the fleet was told to freeze", "coordinator")
    assert frozen in lines
    assert any(line[1:] == (2, "R1 has arrived", "R1") for line in lines)
    assert [line for line in lines if line[1:] == (2, "epoch 2: GO", "coordinator")]


def test_a_fault_tells_of_which_robot_it_is(story):
    fault = FaultSummary(t=2.0, robot="R2", fault="lost its link", kind="link")
    told = dataclasses.replace(story, summary=replace(story.summary, faults=[fault]))
    lines = on("/log", messages_of(write_scene(told, 0.5)))
    ((at, line),) = [(at, line) for at, line in lines if line.level == 4]
    assert at == ZERO + 2 * SECOND
    assert (line.message, line.name) == ("R2: lost its link", "R2")


def test_times_that_no_stamp_holds_become_the_nearest_that_one_does(story):
    for zero, wanted in ((-(10**20), 0), (2**70, 2**32 * SECOND - 1)):
        found = messages_of(write_scene(dataclasses.replace(story, zero_ns=zero), 10.0))
        assert {one.log_time for one in found} == {wanted}


def test_obstacles_of_any_shape_are_filled_exactly():
    schema = SceneUpdate.get_schema()
    read = message_class(schema.name, schema.data)
    chance = random.Random(3)
    for _ in range(20):
        angles = sorted(chance.uniform(0.0, math.tau) for _ in range(9))
        corners = [
            (r * math.cos(a), r * math.sin(a)) for a in angles for r in (chance.uniform(0.5, 3.0),)
        ]
        if not shapely.Polygon(corners).is_valid:
            continue
        floor = Floor(boundary=[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], obstacles=[corners])
        update = SceneUpdate(entities=floor_entities(floor, Timestamp(0, 0)))
        points = read.FromString(update.encode()).entities[1].triangles[0].points
        flat = [(point.x, point.y) for point in points]
        parts = [shapely.Polygon(flat[i : i + 3]) for i in range(0, len(flat), 3)]
        whole = shapely.union_all(parts)
        assert whole.symmetric_difference(shapely.Polygon(corners)).area < 1e-9
        assert sum(part.area for part in parts) == pytest.approx(whole.area)


def test_more_frames_than_anybody_looks_at_are_refused(story):
    with pytest.raises(InputError, match=r"--step: 0.001 s makes .* frames; at most 1,000,000"):
        write_scene(dataclasses.replace(story, last=story.first + 86_400.0), 0.001)
