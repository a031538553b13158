"""The catalogue of servos, robots that are limited by it, and the manual's table of it."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from arm3dof.errors import FrameNotFound, InputError
from arm3dof.model.library import known_servo, load_robot
from arm3dof.model.servos import (
    ALIASES,
    KGF_CM,
    OZF_IN,
    SERVOS,
    effort_warnings,
    servo_data,
)

PAGE = Path(__file__).parent.parent / "docs" / "servos.md"
FREE_JOINT = """<robot name="wheel"><link name="base"/><link name="rim"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hub" type="continuous"><parent link="base"/><child link="rim"/><axis xyz="0 0 1"/>
<limit effort="9" velocity="99"/></joint></robot>"""


def test_the_catalogue_is_possible_and_names_its_sources():
    assert {"DS3218", "MG996R", "STS3215-7.4V", "STS3215-12V", "XL330", "XL430", "LX-16A"} <= set(
        SERVOS
    )
    for name, servo in SERVOS.items():
        assert servo.name == name
        assert 0.1 < servo.stall_torque < 10
        assert 1 < servo.no_load_speed < 20
        assert 0.01 < servo.mass < 0.2
        assert math.radians(0.05) < servo.resolution < math.radians(0.7)
        assert math.radians(120) <= servo.travel <= 2 * math.pi
        assert servo.maker in servo.source
        assert "://" not in servo.source


def test_units_are_converted_once():
    assert servo_data("STS3215-12V").stall_torque == pytest.approx(2.942, abs=1e-3)
    assert servo_data("ds3218").stall_torque == pytest.approx(1.961, abs=1e-3)
    assert servo_data("ds3218").no_load_speed == pytest.approx(7.48, abs=0.01)
    assert servo_data("XL430").no_load_speed == pytest.approx(6.388, abs=1e-3)
    assert pytest.approx(13.8874, abs=1e-3) == KGF_CM / OZF_IN
    for alias, name in ALIASES.items():
        assert servo_data(alias) is SERVOS[name]


@pytest.mark.parametrize("name", SERVOS)
def test_torque_and_speed_follow_the_supply(name):
    rated = SERVOS[name]
    half = rated.at_voltage(rated.voltage / 2)
    assert half.stall_torque == pytest.approx(rated.stall_torque / 2)
    assert half.no_load_speed == pytest.approx(rated.no_load_speed / 2)
    assert (half.mass, half.travel) == (rated.mass, rated.travel)
    for wrong in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="volts above 0"):
            rated.at_voltage(wrong)


@pytest.mark.parametrize("name", SERVOS)
def test_one_servo_for_every_joint(name):
    servo, plain = SERVOS[name], load_robot("arm3dof")
    robot = load_robot("arm3dof", servos=name)
    np.testing.assert_allclose(robot.limits.tau_max, servo.stall_torque)
    np.testing.assert_allclose(robot.limits.v_max, servo.no_load_speed)
    before = plain.limits.q_max - plain.limits.q_min
    after = robot.limits.q_max - robot.limits.q_min
    np.testing.assert_allclose(after, np.minimum(before, servo.travel), atol=1e-6)
    np.testing.assert_allclose(
        robot.limits.q_min + robot.limits.q_max, plain.limits.q_min + plain.limits.q_max, atol=1e-6
    )
    assert not effort_warnings(robot, name)


def test_servos_by_joint_and_overrides_that_go_before_them():
    robot = load_robot(
        "arm3dof", servos={"joint2": "STS3215-12V"}, overrides={"joint3.effort": 1.0}
    )
    np.testing.assert_allclose(robot.limits.tau_max, [1.96, 30 * KGF_CM, 1.0])
    robot = load_robot("arm3dof", servos="XL430", overrides={"joint2.effort": 1.0})
    np.testing.assert_allclose(robot.limits.tau_max, [1.5, 1.0, 1.5])


def test_a_joint_that_turns_freely_gets_the_travel(tmp_path):
    path = tmp_path / "wheel.urdf"
    path.write_text(FREE_JOINT)
    robot = load_robot(path, servos="LX-16A")
    np.testing.assert_allclose(np.rad2deg(robot.limits.q_max), 120)
    assert np.isinf(load_robot(path).limits.q_max).all()


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match=r"no servo 'DS3281'; did you mean 'DS3218'\?"):
        load_robot("arm3dof", servos="DS3281")
    with pytest.raises(FrameNotFound, match="no joint 'wrist'"):
        load_robot("arm3dof", servos={"wrist": "DS3218"})


@pytest.mark.parametrize("robot", ["so100", "so101"])
def test_an_effort_beyond_the_servos_is_warned_of(ask, run, robot):
    assert known_servo(robot) == "STS3215-12V"
    for extra in ([], ["--servos", "STS3215"]):
        code, answer = ask("check", robot, *extra)
        assert (code, answer["ok"]) == (0, True)
        assert len(answer["warnings"]) == 5
        assert "STS3215" in answer["warnings"][0]["what"]
    assert "stalls at 2.94 N m (12 V)" in run("check", robot)[1]


def test_the_reference_arm_is_not_warned_of_until_somebody_asks_for_too_much(ask):
    assert ask("check", "arm3dof")[1]["warnings"] == []
    warnings = ask("check", "arm3dof", "--set", "joint2.effort=2.5")[1]["warnings"]
    assert [warning["where"] for warning in warnings] == ["joint 'joint2'"]
    assert ask("check", "arm3dof", "--servos", "joint1=XL330")[1]["warnings"]


def test_the_command_line_reads_servos(ask, refused):
    answer = ask("simulate", "--servos", "XL430", "--duration", "0.2")[1]
    assert answer["torque_limit_nm"] == pytest.approx(1.5)
    assert "no servo 'foo'" in refused("simulate", "--servos", "foo")
    assert "JOINT=NAME" in refused("simulate", "--servos", "XL430", "--servos", "DS3218")


def test_the_manuals_table_is_the_catalogue():
    rows = re.findall(r"^\| `([^`]+)` \|(.+)\|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    told = {name: [cell.strip() for cell in cells.split("|")] for name, cells in rows}
    assert set(told) == set(SERVOS)
    for name, servo in SERVOS.items():
        assert told[name] == [
            f"{servo.voltage:g}",
            f"{servo.stall_torque:.2f}",
            f"{servo.no_load_speed:.2f}",
            f"{1000 * servo.mass:.0f}",
            f"{math.degrees(servo.resolution):.2f}",
            f"{math.degrees(servo.travel):.0f}",
            servo.source,
        ]
