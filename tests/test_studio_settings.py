"""What was tuned in the studio is written, and read back as it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from arm3dof.cli.studio import tuned_by
from arm3dof.config.studio_file import load_tuned, save_tuned
from arm3dof.control.tuning import Gains
from arm3dof.errors import InputError, MissingFile
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.tuned import Tuned

GAINS = Gains(np.array([4.0, 3.0, 2.0]), np.array([0.3, 0.2, 0.1]), np.zeros(3))
MPC = {
    "formulation": "torque",
    "horizon": 12,
    "dt": 0.02,
    "state_weight": (2.0, 0.1),
    "input_weight": 1e-3,
    "terminal_weight": np.eye(6),
    "blocks": (4, 8),
    "delay": 0.04,
}


@pytest.mark.parametrize(
    "tuned",
    [
        Tuned(),
        Tuned("arm3dof", {"link3.mass": 0.0823, "link2.com.x": -0.01}, "DS3218"),
        Tuned('C:\\a "b".urdf', {}, "", cmd.Control("mpc", MPC, 0.04)),
        Tuned(control=cmd.Control("pid", {"dt": 0.01}, gains=GAINS)),
    ],
    ids=["as it comes", "another arm", "another controller", "PID"],
)
def test_what_is_written_is_read_back(tuned: Tuned, tmp_path: Path) -> None:
    read = load_tuned(save_tuned(tmp_path / "studio.toml", tuned))
    assert (read.source, read.overrides, read.servo) == (
        tuned.source,
        tuned.overrides,
        tuned.servo,
    )
    assert read.control.controller == tuned.control.controller
    assert read.control.delay == tuned.control.delay
    assert read.control.mpc.keys() == tuned.control.mpc.keys()
    for key, value in tuned.control.mpc.items():
        np.testing.assert_array_equal(read.control.mpc[key], value, err_msg=key)
    if tuned.control.gains is not None:
        for name in ("position", "velocity", "integral"):
            np.testing.assert_array_equal(
                getattr(read.control.gains, name), getattr(GAINS, name), err_msg=name
            )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[robot", "is not TOML"),
        ("[control]\ncontroller = 'mpcc'", "control.controller is 'mpcc'; give"),
        ("[control.mpc]\nhorizons = 3", "horizons"),
        ("[control.mpc]\nhorizon = 0", "horizon is 0; give a whole number from 1 to 500"),
        ("[control.mpc]\ndt = nan", "dt"),
        ("[control]\ncontroller = 'pid'", "pid has no gains"),
        ("[control.gains]\nposition = [1.0]\nvelocity = []\nintegral = [0.0]", "lengths"),
        ("[robot.overrides]\n'link3.mass' = 'heavy'", "link3.mass"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_in_a_line(
    text: str, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "studio.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"studio\.toml") as refusal:
        load_tuned(path)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_file_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFile, match="cannot read the settings"):
        load_tuned(tmp_path / "none.toml")


def test_the_command_begins_with_a_file_and_adds_changes(tmp_path: Path) -> None:
    path = save_tuned(tmp_path / "studio.toml", Tuned(overrides={"link3.mass": 0.1}))
    tuned = tuned_by("arm3dof", ["link2.mass=0.2"], path)
    assert tuned.overrides == {"link3.mass": 0.1, "link2.mass": 0.2}
    with pytest.raises(InputError, match="is of the robot arm3dof; leave --robot ur5 away"):
        tuned_by("ur5", None, path)
