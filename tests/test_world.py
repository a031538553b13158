"""Descriptions of worlds: what they hold, what they refuse, and worlds drawn at random."""

import math
from dataclasses import replace

import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.sim.scatter import Region, scatter
from arm3dof.sim.table import Table
from arm3dof.sim.world import COLOURS, MUTED, SHAPES, Bin, Body, World

RED = COLOURS["red"]
CAN = Body("can", "cylinder", 0.03, 0.05, 0.04, RED, 0.18, 0.02)
TRAY = Bin("red", 0.05, 0.2, (0.04, 0.05), RED)


def test_a_world_finds_its_bodies():
    world = World(bodies=(CAN, replace(CAN, name="other", x=0.25)), bins=(TRAY,))
    assert world.body("can") is CAN
    with pytest.raises(InputError, match="no body 'cup'; this world has: can, other"):
        world.body("cup")
    with pytest.raises(InputError, match="has: none"):
        World().body("cup")


def test_a_world_knows_its_table_and_a_bin_its_walls():
    world = World(table=Table(centre=(0.1, 0.0), half_size=(0.3, 0.2)))
    assert world.on_table(0.39, -0.19)
    assert not world.on_table(0.41, 0.0)
    assert not world.on_table(0.1, 0.21)
    assert TRAY.holds(0.089, 0.249)
    assert not TRAY.holds(0.091, 0.2)


def test_a_body_may_stand_in_a_bin():
    inside = replace(CAN, x=0.06, y=0.21)
    assert TRAY.contains(inside)
    assert not TRAY.contains(CAN)
    World(bodies=(inside,), bins=(TRAY,))


def test_a_cubes_reach_is_half_its_diagonal():
    assert CAN.reach == pytest.approx(0.015)
    assert replace(CAN, shape="bottle").reach == pytest.approx(0.015)
    assert replace(CAN, shape="cube").reach == pytest.approx(0.015 * math.sqrt(2))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shape": "cone"}, "body 'can' is a 'cone'; give one of: cylinder, cube, bottle"),
        ({"width_m": 0.0}, "body 'can': width_m is 0.0"),
        ({"height_m": -1.0}, "height_m is -1.0"),
        ({"mass": math.nan}, "mass is nan"),
        ({"x": math.inf}, "x is inf; give a finite number"),
        ({"colour": (1.2, 0, 0)}, "give red, green and blue from 0 to 1"),
        ({"colour": (1, 0)}, "colour has shape"),
    ],
)
def test_impossible_bodies_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        replace(CAN, **change)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: World(light=0.0), "light is 0.0; give a number above 0"),
        (lambda: World(friction=-1.0), "friction is -1.0"),
        (lambda: World(surface="ice"), "the table's surface is 'ice'; give one of: wood, plain"),
        (lambda: World(bodies=(CAN, replace(CAN, x=0.3))), "2 are called body 'can'"),
        (lambda: World(bins=(TRAY, TRAY)), "2 are called bin 'red'"),
        (lambda: World(bodies=(CAN, replace(CAN, name="b", x=0.2))), "'can' and 'b' stand in one"),
        (lambda: World(bodies=(replace(CAN, x=2.0),)), r"at \(2.000, 0.020\) is beyond the table"),
        (
            lambda: World(bodies=(replace(CAN, x=0.09, y=0.2),), bins=(TRAY,)),
            "stands in a wall of bin 'red'",
        ),
        (lambda: replace(TRAY, half_size=(0.1, 0.0)), "bin 'red': half_size_y is 0.0"),
        (lambda: Region(radius=(0.2, 0.1)), "give a lower and a higher one"),
        (lambda: Region(radius=(-0.2, 0.1)), "give metres above 0"),
    ],
)
def test_impossible_worlds_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_scattered_bodies_stand_apart_inside_their_region():
    region, gap = Region((0.15, 0.24), (-1.0, 1.0)), 0.015
    seen = set()
    for seed in range(40):
        bodies = scatter(np.random.default_rng(seed), 6, region=region, gap_m=gap, bins=(TRAY,))
        World(bodies=bodies, bins=(TRAY,))
        assert [body.name.split("_")[0] for body in bodies] == [*COLOURS, *COLOURS][:6]
        for i, body in enumerate(bodies):
            seen.add(body.shape)
            assert 0.15 <= math.hypot(body.x, body.y) <= 0.24
            assert abs(math.atan2(body.y, body.x)) <= 1.0
            assert 0.02 <= body.width_m <= 0.04
            assert 0.010 <= body.mass <= 0.060
            assert body.shape != "cube" or body.height_m == body.width_m
            assert not TRAY.holds(body.x, body.y)
            for other in bodies[:i]:
                apart = math.hypot(body.x - other.x, body.y - other.y)
                assert apart >= body.reach + other.reach + gap - 1e-12
    assert seen == set(SHAPES)


def test_clutter_stands_apart_from_what_is_there():
    rng = np.random.default_rng(2)
    wanted = scatter(rng, 4)
    clutter = scatter(rng, 4, colours=MUTED, others=wanted)
    World(bodies=wanted + clutter)
    assert [body.name for body in clutter] == ["grey_0", "white_1", "black_2", "brown_3"]


def test_a_seed_draws_the_same_world_again():
    assert scatter(np.random.default_rng(5), 9) == scatter(np.random.default_rng(5), 9)


def test_no_room_is_said():
    with pytest.raises(InputError, match="no room for 200 bodies"):
        scatter(np.random.default_rng(0), 200)
