"""``import arm3dof`` and its public names stay light; benchmarks/bench_import.py has the times."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import arm3dof

HEAVY = (
    "cv2",
    "lxml",
    "matplotlib",
    "meshcat",
    "mujoco",
    "nicegui",
    "pink",
    "pydantic",
    "rich",
    "scipy",
    "starlette",
    "sympy",
    "trimesh",
    "typer",
    "uvicorn",
    "yourdfpy",
)


def loaded_after(code):
    """Return the modules that a fresh interpreter has loaded after some code."""
    code += "; import json, sys; print(json.dumps(sorted(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(json.loads(run.stdout))


@pytest.mark.parametrize("code", ["import arm3dof", "from arm3dof import *"])
def test_nothing_heavy_is_imported(code):
    assert not loaded_after(code) & set(HEAVY)


def test_pinocchio_waits_for_the_first_use():
    assert "pinocchio" not in loaded_after("import arm3dof")
    assert "pinocchio" in loaded_after("import arm3dof; arm3dof.load_robot")


def test_every_public_name_exists():
    for name in arm3dof.__all__:
        assert getattr(arm3dof, name) is not None
    assert set(arm3dof.__all__) <= set(dir(arm3dof))


def test_a_name_that_does_not_exist_says_so():
    with pytest.raises(AttributeError, match="no attribute 'load_robots'"):
        _ = arm3dof.load_robots


def test_type_checkers_see_the_same_names():
    """The imports under TYPE_CHECKING name what ``__getattr__`` serves, from the same modules."""
    tree = ast.parse(Path(arm3dof.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.name: statement.module
        for statement in block.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
    served = {name: getattr(arm3dof, name).__module__ for name in seen}
    assert set(seen) == set(arm3dof.__all__) - {"__version__"}
    assert {name: arm3dof._MODULE_OF[name] for name in seen} == seen
    assert all(module.startswith("arm3dof.") for module in served.values())
