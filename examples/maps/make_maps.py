"""Writes the example maps beside this file: `python examples/maps/make_maps.py`; needs ezdxf."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import numpy as np
from PIL import Image

HERE = Path(__file__).parent

GRID = """\
type octile
height 12
width 20
map
@@@@@@@@@@@@@@@@@@@@
@..................@
@..................@
@....@@@....TTT....@
@....@@@....TTT....@
@..................@
@........WW........@
@........WWSS......@
@..................@
@....TT......@.....@
@..................@
@@@@@@@@@@@@@@@@@@@@
"""


def write_lab() -> None:
    """Write a room of 10 m x 8 m as a robot would map it: slanted shelves, unknown outside."""
    y, x = np.mgrid[0:90, 0:110] * 0.1 + 0.05
    x, y = x - 0.5, 8.5 - y
    inside = (x > 0.0) & (x < 10.0) & (y > 0.0) & (y < 8.0)
    near_wall = (x > -0.2) & (x < 10.2) & (y > -0.2) & (y < 8.2)
    across, along = 0.95 * (x - 4.0) - 0.31 * (y - 4.0), 0.31 * (x - 4.0) + 0.95 * (y - 4.0)
    shelf = (abs(across) < 0.3) & (abs(along) < 1.8)
    pillar = (x - 7.2) ** 2 + (y - 3.0) ** 2 < 0.5**2
    picture = np.full(x.shape, 205, np.uint8)
    picture[near_wall] = 0
    picture[inside & ~shelf & ~pillar] = 254
    Image.fromarray(picture).save(HERE / "lab.pgm")
    (HERE / "lab.yaml").write_text(
        "image: lab.pgm\nmode: trinary\nresolution: 0.1\norigin: [-0.5, -0.5, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def write_hall() -> None:
    """Write a hall of 12 m x 8 m, drawn in millimetres, with one obstacle of every kind."""
    ezdxf.options.write_fixed_meta_data_for_testing = True  # the same bytes every time
    drawing = ezdxf.new("R2000")
    drawing.units = ezdxf.units.MM
    for name in ("FLOOR", "WALLS", "REMARKS"):
        drawing.layers.add(name)
    paper = drawing.modelspace()
    walls = {"layer": "WALLS"}
    floor = [(0, 0), (12000, 0), (12000, 8000), (0, 8000)]
    paper.add_lwpolyline(floor, close=True, dxfattribs={"layer": "FLOOR"})
    table = [(2000, 5000, 0), (3500, 5000, 1), (3500, 6000, 0), (2000, 6000, 1)]
    paper.add_lwpolyline(table, format="xyb", close=True, dxfattribs=walls)
    paper.add_circle((6000, 4000), 700, dxfattribs=walls)
    paper.add_ellipse((9000, 5800), (1100, 300), 0.5, dxfattribs=walls)
    paper.add_line((3000, 1500), (4600, 1500), dxfattribs=walls)
    paper.add_arc((3800, 1500), 800, 0, 180, dxfattribs=walls)
    spline = [(8000, 1500), (9500, 1200), (10000, 2600), (8700, 2900), (7900, 2300), (8000, 1500)]
    paper.add_open_spline(spline, dxfattribs=walls)
    paper.add_text("not an obstacle", dxfattribs={"layer": "REMARKS", "height": 200})
    drawing.saveas(HERE / "hall.dxf")


if __name__ == "__main__":
    write_lab()
    write_hall()
    (HERE / "yard.map").write_text(GRID)
