"""Whatever a reader is shown holds: commands run, links lead somewhere, figures are the recorded ones."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from experiments import figures

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / name for name in ("README.md", "CONVENTIONS.md", "CHANGELOG.md")]
README = (ROOT / "README.md").read_text()
FENCE = re.compile(r"^```(\S+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def blocks(mark: str) -> list[str]:
    """The README's shell blocks whose opening line reads ```sh MARK."""
    return [body for language, marks, body in FENCE.findall(README) if language == "sh" and marks.strip() == mark]


def shell(script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    command = ["bash", "-euo", "pipefail", "-c", script]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False)


def test_there_are_commands_to_run():
    assert len(blocks("run")) >= 2
    assert blocks("exits 2")


@pytest.mark.parametrize("script", blocks("run"), ids=lambda script: script.splitlines()[0])
def test_commands_shown_run(script, tmp_path):
    done = shell(script, tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("line", [line for script in blocks("exits 2") for line in script.splitlines()])
def test_bad_input_shown_is_refused_in_one_line(line, tmp_path):
    done = shell(line, tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text()):
        if not target.startswith(("http://", "https://", "#")):
            assert (page.parent / target.partition("#")[0]).exists(), f"{page.name} links to {target}"


def test_make_targets_shown_exist():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    shown = set(re.findall(r"\bmake ([a-z-]+)", README))
    assert {"run", "test", "check"} <= shown
    assert shown <= targets


def test_table_is_the_recorded_figures():
    assert figures.readme_with(README, figures.read_entries()) == README, "run `make figures`"


def test_every_recorded_figure_has_a_row_and_a_command():
    for key, entry in figures.read_entries().items():
        assert set(entry["values"]) == set(figures.ROWS[key].names)
        assert entry["command"].strip()


def test_recording_keeps_the_others_and_refuses_what_has_no_row(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "RESULTS", tmp_path / "results" / "readme.json")
    figures.record("tracking", "weldsim run straight", p95=0.21e-3)
    figures.record("plan_straight", "some script", mean=0.2e-3, p95=0.5e-3, max=1.3e-3)
    assert list(figures.read_entries()) == ["plan_straight", "tracking"]
    shown = figures.table(figures.read_entries())
    assert "| 0.21 mm | <= 0.3 mm | `weldsim run straight` |" in shown
    assert "| 0.20 / 0.50 / 1.30 mm (misses) | <= 0.4 / 0.8 / 1.2 mm |" in shown
    with pytest.raises(ValueError, match="not one of"):
        figures.record("nonsense", "x", p95=1.0)
    with pytest.raises(ValueError, match="the row has"):
        figures.record("tracking", "x", mean=1.0)
