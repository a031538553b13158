"""The notebooks are stored clean, and run from top to bottom."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from browser import chromium, poses, wait_until
from runs import smooth_run

import arm3dof
from arm3dof.errors import InputError
from arm3dof.model.library import load_robot

FOLDER = Path(__file__).parent.parent / "examples" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def named(path: Path) -> str:
    return path.stem


def test_there_are_three() -> None:
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize("path", NOTEBOOKS, ids=named)
def test_it_is_stored_without_outputs(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    notebook = nbformat.reads(text, as_version=4)
    nbformat.validate(notebook)
    assert nbformat.writes(notebook) + "\n" == text
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None
            assert max(map(len, cell.source.splitlines())) <= 120


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=named)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the kernel's client, not ours
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_it_runs_from_top_to_bottom(path: Path, tmp_path: Path) -> None:
    from nbclient import NotebookClient  # slow to import

    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.execute()
    outputs = [each for cell in notebook.cells for each in cell.get("outputs", [])]
    assert not [each for each in outputs if each.get("name") == "stderr"]
    shown = [each["data"]["text/html"] for each in outputs if "text/html" in each.get("data", {})]
    assert any("<iframe srcdoc=" in each for each in shown)


# ---- arm3dof.show --------------------------------------------------------------------------------


def test_show_is_the_page_in_a_frame_of_its_own() -> None:
    run = smooth_run(load_robot(), duration=0.3)
    embedded = arm3dof.show(run, height=300)
    html = embedded._repr_html_()
    assert html.count("<iframe") == 1
    assert 'sandbox="allow-scripts"' in html
    assert 'height="300"' in html
    page = re.search(r'srcdoc="([^"]*)"', html)[1]
    assert "<" not in page
    assert len(html) < 3_000_000
    assert repr(embedded).startswith("arm3dof replay (")
    with pytest.raises(InputError, match="height is 0"):
        arm3dof.show(run, height=0)


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.parametrize("charts", [False, True])
def test_it_plays_inside_another_page(charts: bool, tmp_path: Path) -> None:
    run = smooth_run(load_robot(), duration=0.5)
    html = arm3dof.show(run, charts=charts)._repr_html_()
    page_file = tmp_path / "notebook.html"
    page_file.write_text(f"<!DOCTYPE html><title>notebook</title>{html}")
    with chromium() as browser:
        page = browser.new_page()
        complaints: list[str] = []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(page_file.as_uri(), wait_until="domcontentloaded")
        frame = page.frames[1]
        wait_until(frame, "typeof player !== 'undefined' && player.frames > 1")
        frame.evaluate("player.seek(12)")
        (found,) = poses(frame, ["/robot/link3"])
        assert found is not None
        assert complaints == []
