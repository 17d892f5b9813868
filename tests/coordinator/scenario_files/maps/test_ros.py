import io
import math
import struct
import zlib

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from coordinator.base.errors import InputError
from coordinator.scenario_files.maps.floor_map import MapOptions
from coordinator.scenario_files.maps.map_reader import read_map

YAML = """\
image: site.pgm
resolution: 0.5
origin: [1.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
GREY = np.array([[0, 88, 89, 90], [205, 206, 254, 255]], np.uint8)
PGM = b"P5\n4 2\n255\n" + GREY.tobytes()


def png(pixels, **save):
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", **save)
    return stream.getvalue()


def read(folder, image=PGM, yaml=YAML, **options):
    (folder / "site.pgm").write_bytes(image)
    (folder / "site.yaml").write_bytes(yaml if isinstance(yaml, bytes) else yaml.encode())
    return read_map(folder / "site.yaml", MapOptions(**options))


def problems_of(folder, *arguments, **options):
    with pytest.raises(InputError) as caught:
        read(folder, *arguments, **options)
    assert all(problem.isprintable() for problem in caught.value.problems)
    return caught.value.problems


def blocked(floor, rows, columns, cell=0.5, x=1.0, y=2.0, yaw=0.0):
    """Return which cells block, top row first, by the place of every centre."""
    area = shapely.union_all([shapely.Polygon(corners) for corners in floor.obstacles])
    cos, sin = math.cos(yaw), math.sin(yaw)
    answer = np.zeros((rows, columns), int)
    for row in range(rows):
        for column in range(columns):
            u, v = cell * (column + 0.5), cell * (rows - row - 0.5)
            centre = shapely.Point(x + u * cos - v * sin, y + u * sin + v * cos)
            answer[row, column] = area.covers(centre)
    return answer.tolist()


def free_by_the_book(pixel, yaml):
    """Tell as map_server's image_loader does whether one pixel (a list of channels) is free."""
    scale = "mode: scale" in yaml and len(pixel) == 4
    channels = pixel[:3] if scale else pixel
    average = sum(channels) / len(channels)
    occupation = average / 255.0 if "negate: 1" in yaml else (255 - average) / 255.0
    if occupation > 0.65 or not occupation < 0.196:
        return False
    return not (scale and pixel[3] < 255)


@pytest.mark.parametrize("mode", ["", "mode: trinary\n", "mode: scale\n"])
@pytest.mark.parametrize("negate", ["negate: 0", "negate: 1", "negate: true"])
def test_a_grey_map_blocks_where_map_server_is_not_sure_that_it_is_free(tmp_path, mode, negate):
    yaml = YAML.replace("negate: 0", negate.replace("true", "1")) + mode
    floor = read(tmp_path, yaml=YAML.replace("negate: 0", negate) + mode, map_error=0.0)
    expected = [[int(not free_by_the_book([p], yaml)) for p in row] for row in GREY.tolist()]
    assert blocked(floor, 2, 4) == expected
    assert floor.boundary == ((1.0, 2.0), (3.0, 2.0), (3.0, 3.0), (1.0, 3.0))


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_colours_are_averaged_and_alpha_counts_as_the_mode_says(tmp_path, channels, mode):
    dice = np.random.default_rng(channels)
    levels = np.array([0, 150, 206, 230, 250, 254, 255])
    pixels = dice.choice(levels, (8, 9, channels)).astype(np.uint8)
    if channels == 4:
        pixels[:, ::2, 3] = 255
    yaml = f"{YAML}mode: {mode}\n"
    floor = read(tmp_path, png(pixels), yaml, map_error=0.0)
    expected = [[int(not free_by_the_book(p, yaml)) for p in row] for row in pixels.tolist()]
    assert 0 < sum(map(sum, expected)) < 72
    assert blocked(floor, 8, 9) == expected


def test_pictures_of_other_depths_mean_the_same(tmp_path):
    expected = [[1, 1, 1, 1], [1, 0, 0, 0]]
    plain = b"P2\n# made by hand\n4 2\n255\n" + " ".join(map(str, GREY.ravel())).encode()
    deep = b"P5\n4 2\n65535\n" + (GREY.astype(">u2") * 257).tobytes()
    palette = Image.fromarray(GREY).convert("P")
    stream = io.BytesIO()
    palette.save(stream, "PNG")
    for image in (plain, deep, png(GREY), png(GREY.astype(np.uint16) * 257), stream.getvalue()):
        assert blocked(read(tmp_path, image, map_error=0.0), 2, 4) == expected
    bits = b"P4\n4 2\n" + bytes([0b10100000, 0b00010000])
    assert blocked(read(tmp_path, bits), 2, 4) == [[1, 0, 1, 0], [0, 0, 0, 1]]


def test_the_yaw_of_the_origin_turns_the_map(tmp_path):
    yaml = YAML.replace("2.0, 0.0]", "2.0, 0.7]")
    floor = read(tmp_path, yaml=yaml, map_error=0.0)
    assert blocked(floor, 2, 4, yaw=0.7) == [[1, 1, 1, 1], [1, 0, 0, 0]]
    assert shapely.Polygon(floor.boundary).area == pytest.approx(2.0)


def test_the_note_tells_size_and_growth_and_slanted_walls_save_corners(tmp_path):
    y, x = np.mgrid[0:80, 0:120]
    wall = np.where(abs(y - 0.3 * x - 20) < 5, 0, 254).astype(np.uint8)
    exact, rough = (read(tmp_path, png(wall), map_error=error) for error in (0.0, None))
    assert len(rough.obstacles[0]) < 0.5 * len(exact.obstacles[0])
    assert exact.note.endswith("nothing uncovered, none added")
    assert rough.note.startswith("map site.yaml: 120 x 80 cells of 0.5 m, 1 obstacles with ")
    growth = float(rough.note.split("at most ")[1].split()[0])
    assert 0.0 < growth <= 0.5
    true, grown = (shapely.Polygon(floor.obstacles[0]) for floor in (exact, rough))
    assert grown.buffer(1e-9).covers(true)
    assert true.buffer(growth * 1.001, quad_segs=48).covers(grown)


# Fault: (the changes to the good YAML, words of the line).
YAML_FAULTS = {
    "no image": ("image: site.pgm\n", "", "image: is missing"),
    "an image that is a number": ("site.pgm", "3", "image: 3 is not the name of a file"),
    "an image that is not there": ("site.pgm", "no.pgm", "no.pgm: No such file or directory"),
    "an image that is a folder": ("site.pgm", ".", "is not a file"),
    "no resolution": ("resolution: 0.5\n", "", "resolution: is missing"),
    "a resolution of nothing": ("0.5", "0", "resolution: 0 m is below 0.001 m"),
    "a resolution in words": ("0.5", "fine", "resolution: 'fine' is not a number"),
    "an endless resolution": ("0.5", ".inf", "resolution: inf is not a finite number"),
    "an origin of two": ("[1.0, 2.0, 0.0]", "[1, 2]", "origin: a list of 2 is not [x, y, yaw]"),
    "an origin that is NaN": ("2.0, 0.0]", ".nan, 0.0]", "origin[1]: nan is not a finite number"),
    "an origin far away": (
        "2.0, 0.0]",
        "7999.9, 0.0]",
        "origin: the map reaches beyond 8000 m, wh",
    ),
    "a negate of two": ("negate: 0", "negate: 2", "negate: 2 is not 0 or 1"),
    "a threshold above one": ("0.65", "65", "occupied_thresh: 65 is above 1"),
    "thresholds turned round": ("0.196", "0.7", "free_thresh: 0.7 is above occupied_thresh 0.65"),
    "an unknown mode": ("negate: 0", "negate: 0\nmode: raw", "mode: 'raw' is not one of trinary"),
    "a list": (YAML, "[1, 2]", "a list of 2 is not a table"),
    "an empty file": (YAML, "", "null is not a table"),
    "a syntax error": ("0.5", "[", "line 4: expected ',' or ']'"),
    "a tab": ("negate", "\tnegate", "line 4: found character '\\t' that cannot start any token"),
    "a date that is none": ("0.5", "2001-99-99", "month must be in 1..12"),
    "lists without end": ("0.5", "[" * 1000, "nested too deeply"),
    "an alias": ("[1.0,", "[&a 1.0, *a,", "line 3: a YAML alias, which a map must not contain"),
    "a tag that builds things": ("0.5", "!!python/object:os.system", "constructor for the tag"),
}


@pytest.mark.parametrize("name", YAML_FAULTS)
def test_a_fault_of_the_yaml_is_one_line(tmp_path, name):
    gone, put, words = YAML_FAULTS[name]
    (problem,) = problems_of(tmp_path, yaml=YAML.replace(gone, put))
    assert words in problem


def test_numbers_that_yaml_takes_for_text_are_read_and_faults_are_told_at_once(tmp_path):
    assert read(tmp_path, yaml=YAML.replace("0.5", "5e-1")).boundary[2] == (3.0, 3.0)
    assert len(problems_of(tmp_path, yaml="negate: 7\nmode: x\norigin: 3\nimage: ''\n")) == 7


def chunk(kind, content):
    body = kind + content
    return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))


def huge_png(columns, rows):
    head = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 99))


IMAGE_FAULTS = {
    "nothing": (b"", "is not a whole picture of a known kind (PPM, PNG"),
    "text": (b"hello", "is not a whole picture"),
    "a PGM cut off": (PGM[:-1], "truncated"),
    "a PNG cut off": (png(GREY)[:-30], "truncated"),
    "more cells than allowed": (
        b"P5\n5000 5000\n255\n",
        "5000 x 5000 cells are more than 16777216",
    ),
    "a decompression bomb": (huge_png(12_000, 12_000), "is not a whole picture"),
    "a larger bomb": (huge_png(60_000, 60_000), "is not a whole picture"),
    "real numbers": (b"Pf\n1 1\n-1.0\n" + struct.pack("<f", 1.0), "floating point"),
    "postscript": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "is not a whole picture"),
}


@pytest.mark.parametrize("name", IMAGE_FAULTS)
def test_a_fault_of_the_picture_is_one_line(tmp_path, name):
    image, words = IMAGE_FAULTS[name]
    (problem,) = problems_of(tmp_path, image)
    assert problem.startswith("site.pgm: ")
    assert words in problem


def test_noise_is_refused(tmp_path):
    y, x = np.mgrid[0:1000, 0:1000]
    (problem,) = problems_of(tmp_path, png(np.where((x + y) % 2, 0, 255).astype(np.uint8)))
    assert "that is noise rather than a floor" in problem


@settings(derandomize=True, max_examples=40, deadline=None)
@given(at=st.integers(0, 150), gone=st.integers(0, 9), put=st.binary(max_size=9))
def test_damaged_bytes_are_read_or_refused(tmp_path_factory, at, gone, put):
    folder = tmp_path_factory.getbasetemp()
    good = YAML.encode()
    pictures = [PGM, png(GREY), png(np.dstack([GREY] * 4)), b"P2\n4 2\n255\n1 2 3 4 5 6 7 8"]
    tries = [(picture[:at] + put + picture[at + gone :], good) for picture in pictures]
    problems = []
    for picture, yaml in [*tries, (PGM, good[:at] + put + good[at + gone :]), (put, put)]:
        try:
            assert len(read(folder, picture, yaml).boundary) == 4
        except InputError as error:
            problems += error.problems
    assert all(problem.isprintable() for problem in problems)
