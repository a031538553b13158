"""The graspable region, the ways there, and that both keep clear of everything."""

import numpy as np
import pytest

from arm3dof.model.library import load_robot
from arm3dof.runtime.tasks.clearance import Clearance, Obstacle, held_points
from arm3dof.runtime.tasks.gripping import Grip, Gripping, Placing, graspable
from arm3dof.runtime.tasks.machine import Failure, Refusal
from arm3dof.runtime.tasks.route import BRISK, LIFTED, MARGIN, Planner
from arm3dof.vision.standing import Standing

TABLE = -0.11
ROBOT = load_robot("arm3dof")
GRIPPING = Gripping(ROBOT, TABLE)
PLANNER = GRIPPING.planner


def thing(x=0.18, y=0.0, width=0.03, height=0.05, sigma=0.001):
    return Standing("red", x, y, width, height, sigma**2 * np.eye(2))


def polar(radius, bearing):
    return radius * np.cos(bearing), radius * np.sin(bearing)


def test_every_grip_is_clear_and_around_the_thing():
    rng = np.random.default_rng(0)
    for _ in range(20):
        it = thing(
            *polar(rng.uniform(0.12, 0.235), rng.uniform(-1.5, 1.5)),
            width=rng.uniform(0.02, 0.04),
            height=rng.uniform(0.02, 0.07),
        )
        grip = GRIPPING.grip(it)
        assert isinstance(grip, Grip), grip.sentence
        np.testing.assert_allclose(PLANNER.tool(grip.q)[:2], [it.x, it.y], atol=1e-9)
        assert grip.opening > it.width_m + 2 * it.sigma_m
        assert grip.pitch < 0
        own = PLANNER.clearance.gap(grip.reach.q, grip.opening, [GRIPPING.obstacle(it)])
        assert own.distance > 0
        back = grip.reach.q[0]
        away = PLANNER.tool(back) - grip.point
        np.testing.assert_allclose(away / np.linalg.norm(away), -PLANNER.forearm(grip.q), atol=1e-6)


@pytest.mark.parametrize(
    ("it", "failure", "words"),
    [
        (thing(width=0.07), Failure.TOO_WIDE, "70 mm wide, the fingers open 66 mm"),
        (thing(sigma=0.021), Failure.TOO_UNCERTAIN, "sigma 21 mm > "),
        (thing(x=0.30), Failure.OUT_OF_REACH, "farther away than the arm reaches"),
        (thing(x=-0.20), Failure.OUT_OF_REACH, "would not slant down"),
        (thing(height=0.008), Failure.OUT_OF_REACH, "of the table"),
    ],
)
def test_what_cannot_be_grasped_is_refused_with_its_reason(it, failure, words):
    refusal = graspable(ROBOT, it, TABLE)
    assert isinstance(refusal, Refusal)
    assert refusal.failure is failure
    assert words in refusal.detail


def test_a_neighbour_between_the_fingers_blocks():
    it = thing()
    beside = Obstacle("a wall", 0.18, 0.024, 0.01, TABLE + 0.1)
    refusal = GRIPPING.grip(it, [beside])
    assert isinstance(refusal, Refusal)
    assert refusal.failure is Failure.BLOCKED
    assert "a wall" in refusal.detail
    near = Obstacle("a can", 0.18, 0.055, 0.012, TABLE + 0.04)
    assert isinstance(GRIPPING.grip(it, [near]), Grip)


def test_fingers_open_less_among_others():
    it = thing(width=0.022)
    alone = GRIPPING.grip(it)
    among = GRIPPING.grip(it, [Obstacle("a can", 0.18, 0.044, 0.010, TABLE + 0.04)])
    assert among.opening < alone.opening < GRIPPING.widest


def test_a_thing_is_put_down_upright_where_it_belongs():
    """Tilted by the forearm's slant, it rocks about its lower edge onto the place itself."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        radius = rng.uniform(0.14, 0.22)
        grip = GRIPPING.grip(
            thing(*polar(radius, 0.4), width=0.035, height=rng.uniform(0.03, 0.05))
        )
        x, y = polar(radius + rng.uniform(-0.012, 0.012), -0.5)
        placing = GRIPPING.placing(grip, x, y)
        assert isinstance(placing, Placing), placing.sentence
        q = PLANNER.solve(placing.point)
        assert placing.tilt == pytest.approx(PLANNER.pitch(q) - grip.pitch, abs=1e-3)
        points = grip.held(PLANNER) @ ROBOT.placement(q).rotation.T + placing.point
        assert 0 < points[:, 2].min() - TABLE < 0.003
        # about the edge that touches first, upright again
        low = points[points[:, 2].argmin()]
        outward = np.array([x, y]) / np.hypot(x, y)
        side = np.sign(np.dot(low[:2] - placing.point[:2], outward) or 1.0)
        foot = np.dot(low[:2], outward) - side * 0.035 / 2 * (abs(placing.tilt) > 1e-6)
        if abs(placing.tilt) > 0.02:
            assert foot == pytest.approx(np.hypot(x, y), abs=1.5e-3)


def test_a_place_too_far_off_would_make_it_topple():
    grip = GRIPPING.grip(thing(*polar(0.13, 0.0), width=0.02, height=0.07))
    refusal = GRIPPING.placing(grip, *polar(0.23, 0.5))
    assert isinstance(refusal, Refusal)
    assert "may topple; choose a place about 0.13 m from the base" in refusal.detail
    assert isinstance(GRIPPING.placing(grip, *polar(0.23, 0.5), floor=0.02), Placing)  # into a bin


def test_nothing_is_put_down_where_something_stands():
    grip = GRIPPING.grip(thing())
    x, y = polar(0.2, -0.5)
    for away, free in ((0.0, False), (0.029, False), (0.09, True)):
        there = Obstacle("a cup", x, y - away, 0.015, -0.07)
        placing = GRIPPING.placing(grip, x, y, (there,))
        assert isinstance(placing, Placing) == free
        assert free or "stands a cup" in placing.detail
    flat = Obstacle("a coin", x, y, 0.015, -0.105)
    assert isinstance(GRIPPING.placing(grip, x, y, (flat,), floor=0.04), Placing)


# ---- ways --------------------------------------------------------------------------------------


def random_obstacles(rng, count):
    spots = [polar(rng.uniform(0.15, 0.22), bearing) for bearing in np.linspace(-1, 1, count)]
    return [
        Obstacle(f"can {k}", *spot, rng.uniform(0.01, 0.02), TABLE + rng.uniform(0.03, 0.07))
        for k, spot in enumerate(spots)
    ]


def test_ways_rise_turn_and_descend_clear_of_everything():
    rng = np.random.default_rng(2)
    clearance = Clearance(ROBOT, TABLE)
    planner = Planner(ROBOT, clearance)
    for _ in range(8):
        obstacles = random_obstacles(rng, 6)
        start = np.array([*polar(0.12, rng.uniform(-1, 1)), 0.1])
        end = np.array([*polar(rng.uniform(0.15, 0.22), rng.uniform(-1, 1)), 0.02])
        held = held_points(0.03, 0.05, 0.03, ROBOT.placement(planner.solve(end)))
        legs = planner.travel(start, end, 0.03, obstacles, held)
        assert isinstance(legs, list)
        path = np.concatenate([leg.q for leg in legs])
        np.testing.assert_allclose(planner.tool(path[-1]), end, atol=1e-9)
        assert clearance.gap(path, 0.03, obstacles, held).distance >= MARGIN - 1e-9
        assert max(planner.tool(q)[2] for q in path) >= LIFTED - 1e-9


def test_a_wall_as_high_as_the_arm_blocks_the_way():
    wall = [Obstacle("a wall", 0.19, y, 0.03, 0.4) for y in (-0.05, 0.0, 0.05)]
    refusal = PLANNER.travel([0.13, -0.15, 0.0], [0.13, 0.15, 0.0], 0.05, wall)
    assert isinstance(refusal, Refusal)
    assert refusal.failure is Failure.BLOCKED


def test_trajectories_are_smooth_and_inside_their_pace():
    q = PLANNER.solve([0.15, 0.05, 0.0])
    leg = PLANNER.line([0.15, 0.05, 0.0], [0.1, -0.18, 0.03], BRISK)
    path = PLANNER.follow([leg], q, 2.0)
    assert path.times[0] == 2.0
    times = np.linspace(2.0, path.times[-1], 400)
    v = path.sample(times).v
    assert np.abs(v).max() < 1.15 * BRISK.joint_speed
    np.testing.assert_allclose(v[[0, -1]], 0, atol=1e-9)
    hand = np.array([PLANNER.tool(it) for it in path.sample(times).q])
    assert (np.linalg.norm(np.diff(hand, axis=0), axis=1) / np.diff(times)).max() < 0.5


def test_the_direct_way_is_checked_too():
    q, end = PLANNER.solve([0.13, -0.15, 0.0]), PLANNER.solve([0.13, 0.15, 0.0])
    (leg,) = PLANNER.direct(q, end, 0.05, ())
    np.testing.assert_allclose(leg.q[[0, -1]], [q, end])
    assert np.abs(np.diff(leg.q, axis=0)).max() < 0.05
    refusal = PLANNER.direct(q, end, 0.05, [Obstacle("a wall", 0.19, 0.0, 0.03, 0.4)])
    assert refusal.failure is Failure.BLOCKED
    assert "a wall" in refusal.detail
