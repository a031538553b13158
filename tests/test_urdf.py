"""Validation: each thing that can be wrong is found, named, and comes with a cure."""

import copy
import random
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from urdfs import FINGERS, GOOD

from arm3dof.errors import FrameNotFound, InputError, RobotError
from arm3dof.model.build import pinocchio_text, robot_from_description
from arm3dof.model.robot import Description, Robot
from arm3dof.model.tree import bodies
from arm3dof.model.urdf import read_urdf
from arm3dof.model.validate import body_inertia, lock_positions, validate_urdf

LOCKED = ("finger", "follower")
INERTIA = 'ixx="0.0004" ixy="0" ixz="0" iyy="0.0008" iyz="0" izz="0.0009"'
ELBOW_LIMIT = '<limit lower="-1.5" upper="2" effort="2" velocity="5"/>'
FORE_MASS = '<mass value="0.3"/>'

# (text of the good robot, what it becomes, where, part of what)
HOSTILE = [
    # numbers
    (FORE_MASS, '<mass value="abc"/>', "link 'fore'", '<mass> value "abc" is not a number'),
    (FORE_MASS, '<mass value="1,5"/>', "link 'fore'", '"1,5" is not a number'),
    (FORE_MASS, '<mass value="nan"/>', "link 'fore'", '"nan" is not a number'),
    (FORE_MASS, '<mass value="inf"/>', "link 'fore'", '"inf" is not a number'),
    (FORE_MASS, '<mass value="1e400"/>', "link 'fore'", "beyond 1e+18"),
    (FORE_MASS, '<mass value="0x10"/>', "link 'fore'", "is not a number"),
    (FORE_MASS, '<mass value="1_0"/>', "link 'fore'", "is not a number"),
    (FORE_MASS, '<mass value=""/>', "link 'fore'", "is not a number"),
    (FORE_MASS, '<mass weight="1"/>', "link 'fore'", "<mass> has no value"),
    (FORE_MASS, "", "link 'fore'", "<mass> has no value"),
    ('iyy="0.0008"', "", "link 'fore'", "<inertia> has no iyy"),
    ('iyy="0.0008"', 'iyy="x"', "link 'fore'", '<inertia> iyy "x" is not a number'),
    ('<origin xyz="0.08 0 0"/>', '<origin xyz="0.08 0"/>', "link 'fore'", "is not 3 numbers"),
    ('rpy="0 0.2 0"', 'rpy="0 0.2 0 1"', "joint 'elbow'", "is not 3 numbers"),
    ('rpy="0 0.2 0"', 'quat_xyzw="0 0 0 1"', "joint 'elbow'", "quat_xyzw is not supported"),
    ('xyz="0 2 1"', 'xyz="z"', "joint 'elbow'", '<axis> xyz "z" is not 3 numbers'),
    ('damping="0.2"', 'damping="much"', "joint 'pan'", '<dynamics> damping "much"'),
    ('upper="2"', 'upper="${pi}"', "joint 'elbow'", "is not a number"),
    # shapes
    ('size="0.2 0.04 0.04"', "", "link 'upper' visual", "<box> has no size"),
    ('radius="0.03"', 'radius="-1"', "link 'upper' collision", "is not positive"),
    ('<sphere radius="0.03"/>', "", "link 'upper' collision", "holds nothing"),
    ('<sphere radius="0.03"/>', "<torus/>", "link 'upper' collision", "holds torus"),
    ('<sphere radius="0.03"/>', "<mesh/>", "link 'upper' collision", "<mesh> has no filename"),
    (
        '<sphere radius="0.03"/>',
        '<mesh filename="a.stl" scale="1 1"/>',
        "link 'upper' collision",
        '<mesh> scale "1 1" is not 3 numbers',
    ),
    ('<origin xyz="0 0 0.1"', '<origin xyz="0 0 up"', "link 'base' visual", "is not 3 numbers"),
    ('<material name="grey"/>', "<material/>", "link 'base' visual", "<material> has no name"),
    ('rgba="0.5 0.5 0.5 1"', 'rgba="128 0 0 1"', "material 'grey'", "outside 0 to 1"),
    ('rgba="0.5 0.5 0.5 1"', "", "material 'grey'", "<color> has no rgba"),
    ('<color rgba="0.5 0.5 0.5 1"/>', "", "material 'grey'", "neither color nor texture"),
    ('<color rgba="0.5 0.5 0.5 1"/>', "<texture/>", "material 'grey'", "has no filename"),
    (
        '<link name="base">',
        '<material name="grey"><color rgba="0 0 0 1"/></material><link name="base">',
        "material 'grey'",
        "is defined twice",
    ),
    # names and ends
    ('<robot name="small"', "<robot", "<robot>", "has no name"),
    ('version="1.0">', 'version="2.0">', "<robot>", 'version "2.0" is unknown'),
    ('<joint name="plate"', "<joint", "<joint>", "has no name"),
    ('joint name="plate"', 'joint name="elbow"', "joint 'elbow'", "is defined 2 times"),
    ('joint name="plate"', 'joint name="universe"', "joint 'universe'", "is a reserved name"),
    ('<parent link="bracket"/>', "", "joint 'elbow'", "has no parent link"),
    ('<child link="grip_tcp"/>', "<child/>", "joint 'tip'", "has no child link"),
    ('<parent link="bracket"/>', '<parent link="x"/>', "joint 'elbow'", "'x' does not exist"),
    # joint types
    ('name="elbow" type="revolute"', 'name="elbow"', "joint 'elbow'", "has no type"),
    ('name="elbow" type="revolute"', 'name="elbow" type="hinge"', "joint 'elbow'", "is unknown"),
    (
        'name="elbow" type="revolute"',
        'name="elbow" type="planar"',
        "joint 'elbow'",
        "more than one degree of freedom",
    ),
    (
        'name="elbow" type="revolute"',
        'name="elbow" type="floating"',
        "joint 'elbow'",
        "more than one degree of freedom",
    ),
    # joint values
    ('xyz="0 2 1"', 'xyz="0 0 0"', "joint 'elbow'", "its axis is zero"),
    ('upper="2"', 'upper="-2"', "joint 'elbow'", "lower limit -1.5 is not below upper limit -2"),
    ('lower="-1.5" upper="2"', "", "joint 'elbow'", "lower limit 0 is not below upper limit 0"),
    ('effort="2"', "", "joint 'elbow'", "effort limit is missing"),
    ('effort="2"', 'effort="0"', "joint 'elbow'", "effort limit is 0"),
    ('effort="2"', 'effort="-2"', "joint 'elbow'", "effort limit is -2"),
    ('effort="3"', "", "joint 'pan'", "effort limit is missing"),
    ('velocity="5"', "", "joint 'elbow'", "velocity limit is missing"),
    ('velocity="5"', 'velocity="0"', "joint 'elbow'", "velocity limit is 0"),
    ('velocity="5"', 'velocity="-1"', "joint 'elbow'", "velocity limit is -1"),
    ('damping="0.2"', 'damping="-0.2"', "joint 'pan'", "damping -0.2 is negative"),
    ('friction="0.05"', 'friction="-1"', "joint 'elbow'", "friction -1 is negative"),
    (
        ELBOW_LIMIT,
        ELBOW_LIMIT + '<mimic joint="pan"/>',
        "joint 'elbow'",
        "mimics 'pan', which is not supported",
    ),
    (ELBOW_LIMIT, ELBOW_LIMIT * 2, "joint 'elbow'", "has 2 <limit> elements"),
    # bodies
    (FORE_MASS, FORE_MASS * 2, "link 'fore'", "has 2 <mass> elements"),
    (FORE_MASS, '<mass value="0"/>', "link 'fore'", "moves and has zero mass"),
    (FORE_MASS, '<mass value="-0.3"/>', "link 'fore'", "mass -0.3 kg is negative"),
    ('<mass value="0"/>', '<mass value="-0.1"/>', "link 'bracket'", "is negative"),
    ('ixx="0.0004"', 'ixx="-0.0004"', "link 'fore'", "is not positive definite"),
    ('ixx="0.0004"', 'ixx="0"', "link 'fore'", "is not positive definite"),
    ('ixx="0.0004" ixy="0"', 'ixx="0.0004" ixy="1"', "link 'fore'", "is not positive definite"),
    (INERTIA, INERTIA.replace("0.0009", "0.0013"), "link 'fore'", "is that of no solid"),
]


def change(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def problems(text: str) -> list[str]:
    return [str(problem) for problem in validate_urdf(text, LOCKED)]


def test_good_robot_has_no_problems():
    assert validate_urdf(GOOD, LOCKED) == ()
    assert validate_urdf(GOOD.encode(), FINGERS) == ()
    assert validate_urdf("\ufeff" + GOOD.partition("\n")[2], LOCKED) == ()


@pytest.mark.parametrize(("old", "new", "where", "what"), HOSTILE)
def test_each_fault_is_the_one_problem_found(old, new, where, what):
    (problem,) = validate_urdf(change(old, new), LOCKED)
    assert problem.where.partition(" (and fixed")[0] == where
    assert what in problem.what
    assert problem.cure
    with pytest.raises(RobotError, match=r"^x\.urdf: ") as caught:
        robot_from_description(
            Description("x.urdf", change(old, new), locked_joints=dict.fromkeys(LOCKED, 0.0))
        )
    assert caught.value.problems == (problem,)


def test_all_faults_are_found_at_once():
    text = change('effort="2"', 'effort="0"').replace(FORE_MASS, '<mass value="abc"/>')
    text = text.replace('damping="0.2"', 'damping="-1"').replace('xyz="0 2 1"', 'xyz="0 0 0"')
    found = " ".join(problems(text))
    for part in ("abc", "axis is zero", "effort limit is 0", "damping -1"):
        assert part in found


@pytest.mark.parametrize(
    "text", ["", "   ", "hello", "<robot", "<robot><link></robot>", "<a/><b/>"]
)
def test_broken_xml_says_where(text):
    (problem,) = validate_urdf(text)
    assert problem.where.startswith("line 1, column ")
    assert problem.what.startswith("broken XML: ")


def test_broken_xml_names_its_line():
    (problem,) = validate_urdf(change('<link name="grip_tcp"/>', '<link name="grip_tcp">'))
    last_line = GOOD.count("\n")
    assert problem.where.startswith(f"line {last_line}, ")
    assert "mismatched tag" in problem.what


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("<sdf/>", "not a URDF"),
        ("<mujoco><worldbody/></mujoco>", "not a URDF"),
        ('<robot name="r" xmlns:xacro="urn:xacro"><xacro:macro/></robot>', "xacro"),
        ('<robot name="r"/>', "has no links"),
        ('<robot name="r"><link name="a"/></robot>', "has no joint that moves"),
        ('<robot name="r">' + "<a>" * 60 + "</a>" * 60 + "</robot>", "nested deeper than 50"),
        (b'<?xml version="1.0" encoding="klingon"?><robot/>', "unreadable text"),
        (b'<?xml version="1.0" encoding="utf-7"?><robot/>', "unreadable text"),
        ("<robot name='\ud800'/>", "unreadable text"),
    ],
)
def test_what_is_no_usable_robot_says_so(source, what):
    (problem,) = validate_urdf(source)
    assert what in problem.what
    assert problem.cure


def test_default_namespace_and_extras_are_let_pass():
    text = change("<robot ", '<robot xmlns="http://ros.org" ')
    assert validate_urdf(text, LOCKED) == ()


# ---- the tree ------------------------------------------------------------------------------------


def joint(name: str, parent: str, child: str) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="fixed">{ends}</joint>'


def with_more(text: str) -> str:
    return change("</robot>", text + "</robot>")


def test_two_parents_which_crash_pinocchio():
    (problem,) = validate_urdf(with_more(joint("second", "base", "fore")), LOCKED)
    assert problem.where == "link 'fore'"
    assert "elbow, second" in problem.what


def test_a_loop_beside_the_tree():
    loop = '<link name="a"/><link name="b"/>' + joint("ab", "a", "b") + joint("ba", "b", "a")
    (problem,) = validate_urdf(with_more(loop), LOCKED)
    assert problem.where == "links a, b"
    assert "loop" in problem.what


def test_a_loop_through_the_root():
    (problem,) = validate_urdf(with_more(joint("back", "slider", "base")), LOCKED)
    assert "loop" in problem.what
    assert "base" in problem.where


def test_a_link_that_is_its_own_parent():
    found = problems(with_more('<link name="a"/>' + joint("aa", "a", "a")))
    assert len(found) == 1
    assert found[0].startswith("links a: hang on one another in a loop")


def test_several_roots():
    (problem,) = validate_urdf(with_more('<link name="island"/>'), LOCKED)
    assert problem.what == "has several root links: base, island"


def test_link_without_a_name():
    found = problems(change('<link name="grip_tcp"/>', "<link/>"))
    assert found[0].startswith("<link>: has no name")
    assert found[1].startswith("joint 'tip': child link 'grip_tcp' does not exist")
    assert len(found) == 2


def test_link_defined_twice():
    found = problems(with_more('<link name="fore"/>'))
    assert found[0].startswith("link 'fore': is defined 2 times")


def test_missing_inertial_on_a_moving_body():
    root = ElementTree.fromstring(GOOD)
    link = next(element for element in root.findall("link") if element.get("name") == "fore")
    link.remove(link.find("inertial"))
    (problem,) = validate_urdf(ElementTree.tostring(root), LOCKED)
    assert (problem.where, problem.what) == ("link 'fore'", "moves and has no <inertial>")


# ---- bodies and locks ----------------------------------------------------------------------------


def test_locked_joints_may_have_faults_that_then_do_not_matter():
    limit = '<limit lower="0" upper="0.02" effort="5" velocity="0.1"/>\n    <mimic'
    assert validate_urdf(change(limit, "<mimic"), LOCKED) == ()
    (problem,) = validate_urdf(GOOD)
    assert problem.where == "joint 'follower'"
    assert "locked_joints=['follower']" in problem.cure
    assert validate_urdf(GOOD, ("finger",)) == ()


def test_merged_inertia_equals_pinocchios():
    urdf, _ = read_urdf(GOOD)
    locked = {**FINGERS, "slide": 0.05}
    model = pin.buildModelFromXML(pinocchio_text(urdf, locked))
    moving = [body for body in bodies(urdf, locked) if body.joint is not None]
    assert [body.joint.name for body in moving] == list(model.names[1:])
    for body, expected in zip(moving, list(model.inertias)[1:], strict=True):
        mass, inertia = body_inertia(body)
        np.testing.assert_allclose(mass, expected.mass, rtol=1e-14)
        np.testing.assert_allclose(inertia, expected.inertia, atol=1e-16)


def test_locked_names_are_held_at_zero_or_the_nearest_limit():
    urdf, _ = read_urdf(GOOD)
    assert lock_positions(urdf, ["slide", "elbow", "pan"]) == {
        "slide": 0.01,
        "elbow": 0.0,
        "pan": 0.0,
    }
    assert lock_positions(urdf, "finger") == {"finger": 0.0, "follower": 0.0}
    assert lock_positions(urdf, {"pan": 12.5}) == {"pan": 12.5}
    assert lock_positions(urdf, ()) == {}


def test_locking_what_cannot_be_locked():
    with pytest.raises(FrameNotFound, match="no movable joint 'plate'; this robot has: pan, elbow"):
        validate_urdf(GOOD, ("plate",))
    for position in (2.5, float("nan"), "0"):
        with pytest.raises(InputError, match="locked joint 'elbow' is at"):
            validate_urdf(GOOD, {"elbow": position})


def test_all_joints_locked():
    (problem,) = validate_urdf(GOOD, ("pan", "elbow", "slide", "finger", "follower"))
    assert problem.what == "has no joint that moves"


# ---- fuzz ----------------------------------------------------------------------------------------

JUNK = (
    *("", "abc", "1,5", "nan", "inf", "-inf", "-1", "0", "2", "0 0 0", "0 0", "1 1 1", "1e400"),
    *(
        "1e-400",
        "1e17",
        "-1e18",
        "1e-17",
        "0x10",
        "1_0",
        " 1 ",
        "1\t2\t3",
        "\n",
        "1.",
        "+.5",
        "--1",
    ),
    *(
        "base",
        "upper",
        "fore",
        "slider",
        "universe",
        "floating",
        "fixed",
        "prismatic",
        "é",
        "<",
        "&",
    ),
)


def mutant(rng: random.Random) -> str:
    """Return the good robot with one to three things broken."""
    root = ElementTree.fromstring(GOOD)
    for _ in range(rng.choice((1, 1, 2, 3))):
        element = rng.choice(list(root.iter()))
        action = rng.random()
        if action < 0.7 and element.attrib:
            element.set(rng.choice(sorted(element.attrib)), rng.choice(JUNK))
        elif action < 0.8 and element.attrib:
            del element.attrib[rng.choice(sorted(element.attrib))]
        elif action < 0.9 and len(element):
            element.remove(rng.choice(list(element)))
        elif len(element):
            element.append(copy.deepcopy(rng.choice(list(element))))
    return ElementTree.tostring(root, encoding="unicode")


def robot_or_none(text: str) -> Robot | None:
    try:
        return robot_from_description(Description("mutant", text, locked_joints=FINGERS))
    except RobotError:
        return None


def test_a_damaged_robot_is_refused_or_moves_finitely(capfd):
    rng = random.Random(7)
    generator = np.random.default_rng(7)
    loaded = 0
    for _ in range(400):
        robot = robot_or_none(mutant(rng))
        if robot is None:
            continue
        loaded += 1
        q = robot.random_configuration(generator)
        v, tau = generator.normal(size=(2, robot.nv))
        acceleration = robot.forward_dynamics(q, v, tau)
        assert np.isfinite(acceleration).all()
        assert np.isfinite(robot.inverse_dynamics(q, v, acceleration)).all()
        assert np.isfinite(robot.placement(q).homogeneous).all()
    assert 30 < loaded < 300
    assert capfd.readouterr() == ("", "")
