"""The campaigns against the controller, small enough to run often."""

import pytest

from arm3dof import MpcSettings
from benchmarks import campaign_control, campaign_fuzz, campaign_loops
from benchmarks.campaign_loops import Conditions


@pytest.mark.slow
def test_hostile_steps_violate_nothing():
    found, tables = campaign_control.fuzz(300, seed=5)
    assert found["steps"] == 300
    assert found["violations"] == {}, found["examples"]
    assert found["compared_with_fresh"] > 0
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)


@pytest.mark.slow
def test_an_arm_without_speed_is_answered_as_by_a_fresh_controller_where_rows_are_dependent():
    found = campaign_fuzz.summary(campaign_fuzz.run_fuzz((0, range(52, 53))))
    assert found["violations"] == {}, found["examples"]
    assert found["compared_with_fresh"] > 20
    assert found["largest_difference_nm"] == 0.0


@pytest.mark.slow
def test_random_loops_settle_without_noise_and_every_other_one_is_explained():
    conditions = {
        "exact": Conditions(MpcSettings(), model_error=0.0, noise_deg=0.0),
        "noisy": Conditions(MpcSettings(), noise_deg=0.5),
    }
    found, tables = campaign_control.loops(4, 3, conditions)
    assert found["exact"]["fraction"] == 1.0
    late = found["noisy"]["not_in_time"]
    assert len(late) == found["noisy"]["loops"] - found["noisy"]["settled_in_time"]
    assert all(loop["cause"] for loop in late)
    assert [len(row) for row in tables[0].rows] == [len(tables[0].columns)] * 2


def test_a_loop_is_the_same_whenever_it_is_run():
    task = (Conditions(MpcSettings(), noise_deg=0.0), 0, range(2))
    first, again = campaign_loops.run_loops(task), campaign_loops.run_loops(task)
    assert [loop.index for loop in first] == [loop.index for loop in again] == [0, 1]
    for one, other in zip(first, again, strict=True):
        # to rounding, which depends on where the matrices lie in memory
        assert one.error_deg == pytest.approx(other.error_deg, rel=1e-6)
        assert one.settling_time == pytest.approx(other.settling_time)


def test_a_disturbance_that_is_real_is_kept_beside_an_end_stop():
    # joint 2 has to stay 0.24 deg from its stop, where noise makes it look as if it leant on it
    (loop,) = campaign_loops.run_loops((Conditions(MpcSettings()), 0, range(654, 655)))
    assert loop.in_time
    assert loop.error_deg < 0.2
