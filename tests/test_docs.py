"""What the manual and the README print is what the package does."""

import contextlib
import doctest
import io
import json
import re
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer

import arm3dof
from arm3dof.cli import app
from arm3dof.config.camera_file import load_camera, parse_camera
from arm3dof.ui.demo_scene import draw_demo

ROOT = Path(__file__).parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
SESSION = re.compile(r"^```pycon\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PYTHON = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
JSON = re.compile(r"^```json\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def named(page):
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_snippets_print_what_the_page_says(page):
    text = page.read_text(encoding="utf-8")
    session = "\n".join(SESSION.findall(text))
    test = doctest.DocTestParser().get_doctest(session, {}, named(page), str(page), 0)
    report: list[str] = []
    doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test, out=report.append)
    assert not report, "".join(report)


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{named(page)} links to {target}"


def test_the_readmes_program_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    programs = PYTHON.findall(text)
    assert len(programs) == 1
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(programs[0], "README.md", "exec"), {})
    assert "settled=True" in said.getvalue()
    assert (tmp_path / "report.html").is_file()


def test_the_versions_agree():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {arm3dof.__version__}\n" in citation


def test_the_cameras_file_that_is_shown_can_be_read():
    page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```toml\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    camera, targets = parse_camera(text, "formats.md")
    assert camera.width == 640
    assert targets["green"].shape == "cylinder"


# ---- the command line --------------------------------------------------------------------------


def sections():
    """Return the part of the manual that is about each command."""
    text = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    parts = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@cache
def commands(group=None, prefix=""):
    """Return every command of the program by its full name."""
    found = {}
    for name, command in (group or typer.main.get_command(app.app)).commands.items():
        if hasattr(command, "commands"):
            found |= commands(command, f"{prefix}{name} ")
        else:
            found[prefix + name] = command
    return found


def test_every_command_has_its_section():
    assert set(sections()) == set(commands())


@pytest.mark.parametrize("name", commands())
def test_every_option_is_named(name):
    usage = sections()[name]
    for parameter in commands()[name].params:
        names = [*parameter.opts, *parameter.secondary_opts]
        options = [option for option in names if option.startswith("--")]
        if "--help" not in options and options:
            assert any(option in usage for option in options), f"{name} {options}"


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """What each command that ends by itself prints with --json."""
    folder = tmp_path_factory.mktemp("answers")
    picture = draw_demo(load_camera("paper").camera, np.random.default_rng(0))
    cv2.imwrite(str(folder / "table.png"), picture)
    words = {
        "demo": ["--no-serve", "--out", folder / "out"],
        "ik": ["0.12", "0.05", "0.08"],
        "simulate": ["--duration", "2"],
        "see": [folder / "table.png", "--camera", "paper", "--target", "green"],
        "calibrate focal": [folder / "table.png", "--distance-m", "0.25", "--width-m", "0.03"],
        "check": ["arm3dof"],
        "robots": [],
        "doctor": [],
    }
    answers = {}
    for name, given in words.items():
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            assert app.main([*name.split(), *map(str, given), "--json"]) == 0
        answers[name] = json.loads(said.getvalue())
    return answers


def keys(value):
    """Return the names in a JSON value; of a list, those of its first item."""
    if isinstance(value, dict):
        return {name: keys(item) for name, item in value.items() if name != "status_counts"}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [keys(value[0])]
    return None


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["demo", "ik", "simulate", "see", "calibrate focal", "check", "robots", "doctor"]
)
def test_the_answer_has_the_names_that_the_manual_shows(answers, name):
    (shown,) = (json.loads(block) for block in JSON.findall(sections()[name]))
    real = answers[name]
    for part in ("objects", "refused"):
        if part in shown and not shown[part]:
            real = {**real, part: []}
    assert keys(shown) == keys(real)
    assert list(shown) == list(real)
