"""What all tests share: reproducible examples, one thread a process, the program's commands."""

import json
import os
import signal

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import pytest
from hypothesis import settings

from arm3dof.cli import app

settings.register_profile("arm3dof", deadline=None, derandomize=True, print_blob=False)
settings.load_profile("arm3dof")

# A shell's background job ignores Ctrl-C, and so would the programs that the tests start and stop.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

LONGEST = (
    "18_sort",
    "test_it_runs_from_top_to_bottom",
    "test_memory_is_flat_over_simulated_time",
    "test_the_camera_is_filmed",
    "test_the_goals_are_reached_over_three_hundred_tables",
)


def pytest_collection_modifyitems(items):
    """Begin with the longest, lest one core waits at the end for another that has just begun."""
    items.sort(key=lambda item: not any(name in item.nodeid for name in LONGEST))


@pytest.fixture
def run(capsys):
    """Return a function that runs a command and returns (exit code, stdout, stderr)."""

    def call(*words):
        code = app.main([str(word) for word in words])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def ask(run):
    """Return a function that runs a command with --json and returns (exit code, object)."""

    def call(*words):
        code, out, err = run(*words, "--json")
        assert err == "", err
        return code, json.loads(out, parse_constant=lambda name: pytest.fail(f"JSON holds {name}"))

    return call


@pytest.fixture
def refused(run):
    """Return a function that runs a command, which must refuse its input, and returns why."""

    def call(*words):
        code, out, err = run(*words)
        assert (code, out) == (2, "")
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        return err.removeprefix("error: ").rstrip()

    return call
