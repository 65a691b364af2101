"""What a forge and a maintainer find: workflows, hooks, templates, one version."""

from __future__ import annotations

import os
import re
import subprocess

import pytest
import yaml

from tests.builders import ROOT

WORKFLOW = ROOT / ".github" / "workflows" / "tests.yml"


def loaded(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def marked(name):
    """The commands of the README after a mark, read without the shell."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.search(rf"<!-- {name} -->\n```sh\n(.*?)```", text, re.S)[1]


@pytest.mark.parametrize("name", ["first", "tests"])
def test_ci_reads_the_commands_of_the_readme(name):
    found = subprocess.run([ROOT / ".ci" / "readme", name], capture_output=True, check=True)
    assert found.stdout.decode() == marked(name)


@pytest.mark.parametrize(("system", "folder"), [("Linux", "bin"), ("Windows", "Scripts")])
def test_the_workflow_runs_both_commands_on_every_system(tmp_path, system, folder):
    """Its own script, with commands that write down that they were called."""
    job = loaded(WORKFLOW)["jobs"]["readme"]
    (script,) = (step["run"] for step in job["steps"] if "run" in step)
    shown = script.replace('bash -euo pipefail -c "$command"', 'echo "$command" >> "$LOG"')
    assert shown != script
    shown = shown.replace("rm -rf .venv", ":")
    log = tmp_path / "log"
    env = {**os.environ, "RUNNER_OS": system, "LOG": str(log)}
    subprocess.run(["bash", "-euo", "pipefail", "-c", shown], check=True, cwd=ROOT, env=env)
    ran = log.read_text()
    both = marked("first") + marked("tests")
    expected = both.replace(".venv/bin", f".venv/{folder}")
    assert ran == (expected.replace("python3", "python") if system == "Windows" else expected)


def test_workflows_cover_systems_versions_and_all_of_ci():
    jobs = loaded(WORKFLOW)["jobs"]
    matrix = jobs["readme"]["strategy"]["matrix"]
    kinds = ("ubuntu-24.04", "ubuntu-24.04-arm", "macos", "windows")
    assert all(any(system.startswith(kind) for system in matrix["system"]) for kind in kinds)
    oldest = re.search(r'requires-python = ">=(.*)"', (ROOT / "pyproject.toml").read_text())[1]
    assert min(matrix["python"]) == oldest
    scripts = [step.get("run", "") for job in jobs.values() for step in job["steps"]]
    for script in (".ci/run", ".ci/versions python3.11 python3.13"):
        assert script in scripts
        assert os.access(ROOT / script.split()[0], os.X_OK)


def test_hooks_check_what_ci_checks():
    hooks = loaded(ROOT / ".pre-commit-config.yaml")["repos"][0]["hooks"]
    entries = {hook["entry"].split(" --force")[0] for hook in hooks}
    run = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    checked = re.findall(r"^\.venv/bin/(?:ruff \w+(?: --check)?|mypy)", run, re.M)
    assert entries == {*checked}
    assert len(checked) == 3


def test_templates_are_forms_with_questions():
    forms = [loaded(p) for p in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")]
    asked = [form for form in forms if "body" in form]
    assert len(asked) >= 2
    assert all(form["name"] and form["description"] for form in asked)
    assert all(part["attributes"]["label"] for form in asked for part in form["body"])


def test_one_version_is_said_everywhere():
    project = re.search(r'^version = "(.*)"', (ROOT / "pyproject.toml").read_text(), re.M)[1]
    assert str(loaded(ROOT / "CITATION.cff")["version"]) == project
    assert f"\n## [{project}] - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_no_page_is_wider_than_the_window():
    """The width of the text and of both side bars, by the numbers of the style sheet and of furo.

    Furo: side bars of 15em, the right one from 82em on, the left one from 63em on; letters are a
    tenth larger from 97em on. A scroll bar takes 17 pixels.
    """
    css = (ROOT / "docs" / "_static" / "site.css").read_text(encoding="utf-8")
    (width,) = map(float, re.findall(r"\.content \{ width: (\d+)em", css))
    beside = [float(each) for each in re.findall(r"calc\(100vw - ([\d.]+)em\)", css)]
    (half,) = map(float, re.findall(r"\.sidebar-drawer \{ width: calc\(50% - (\d+)em\)", css))
    for pixels in range(1010, 2600):
        em = pixels / (16 if pixels < 97 * 16 else 17.6)
        two = pixels > 82 * 16
        left = max(15.0, (pixels - 17) / pixels * em / 2 - half)
        text = min(width, em - beside[0 if two else 1])
        assert left + text + 15.0 * two <= em * (pixels - 17) / pixels, pixels
