"""The table of states: complete, reachable, and every reason has its sentence."""

import pytest

from arm3dof.runtime.tasks.machine import TRANSITIONS, Event, Failure, Phase, Refusal, Step


def test_every_phase_has_a_row_and_only_the_last_two_have_no_way_out():
    assert set(TRANSITIONS) == set(Phase)
    for phase, row in TRANSITIONS.items():
        assert bool(row) != phase.is_final


def test_every_phase_is_reached_from_the_first_and_leads_to_an_end():
    def reach(start):
        found, new = {start}, [start]
        while new:
            new = [it for it in TRANSITIONS[new.pop()].values() if it not in found] + new
            found |= set(new)
        return found

    assert reach(Phase.LOOK) == set(Phase)
    for phase in Phase:
        if not phase.is_final:
            assert {Phase.DONE, Phase.FAILED} <= reach(phase)


@pytest.mark.parametrize("kind", [Phase, Event, Failure])
def test_each_has_a_sentence_of_its_own(kind):
    assert len({member.sentence for member in kind}) == len(kind)


def test_every_event_occurs():
    assert {event for row in TRANSITIONS.values() for event in row} == set(Event)


def test_reasons_carry_their_figures():
    step = Step(1.0, Phase.CLOSE, Event.HELD, Phase.LIFT, "30 mm")
    assert step.reason == "the fingers have stopped at the thing's width (30 mm)"
    assert (
        Step(1.0, Phase.REACH, Event.ARRIVED, Phase.CLOSE).reason == "the arm is where it was to go"
    )
    refusal = Refusal(Failure.TOO_UNCERTAIN, "sigma 21 mm > 8 mm; move the camera nearer")
    assert refusal.sentence.endswith("sigma 21 mm > 8 mm; move the camera nearer")
