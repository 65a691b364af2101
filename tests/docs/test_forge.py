"""What a forge and a maintainer find: workflows, hooks, templates, one version."""

import os
import re
import subprocess
import tomllib

import pytest
import yaml

from seqopt._cli.registry import COMMANDS
from tests.builders import ROOT
from tests.commands import command

WORKFLOW = ROOT / ".github" / "workflows" / "tests.yml"


def loaded(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def marked(name):
    """The commands of the README after a mark, read without the shell."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.search(rf"<!-- {name} -->\n```sh\n(.*?)```", text, re.S)[1]


@pytest.mark.parametrize(
    ("system", "python", "folder"), [("", "python3", "bin"), ("Windows_NT", "python", "Scripts")]
)
@pytest.mark.parametrize("name", ["first", "tests"])
def test_ci_reads_the_commands_of_the_readme(name, system, python, folder):
    env = {**os.environ, "OS": system}
    found = subprocess.run(
        ["bash", ROOT / ".ci" / "readme", name], capture_output=True, check=True, env=env
    )
    expected = marked(name).replace("python3", python).replace(".venv/bin", f".venv/{folder}")
    assert found.stdout.decode() == expected


def test_the_workflow_runs_both_commands(tmp_path):
    """Its own script, which writes down the commands instead of running them."""
    job = loaded(WORKFLOW)["jobs"]["readme"]
    (script,) = (step["run"] for step in job["steps"] if "run" in step)
    shown = script.replace("bash -euo pipefail -c", "printf '%s\\n'").replace("rm -rf .venv", ":")
    assert "printf" in shown
    assert ".venv" not in shown
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", shown],
        capture_output=True,
        check=True,
        cwd=ROOT,
        env={**os.environ, "OS": ""},
    )
    assert done.stdout.decode() == marked("first") + marked("tests")


def test_workflows_cover_systems_versions_and_all_of_ci():
    jobs = loaded(WORKFLOW)["jobs"]
    kinds = ("ubuntu-24.04", "ubuntu-24.04-arm", "macos", "windows")
    oldest = re.search(r'requires-python = ">=(.*)"', (ROOT / "pyproject.toml").read_text())[1]
    for name in ("readme", "ci"):
        matrix = jobs[name]["strategy"]["matrix"]
        assert all(any(system.startswith(kind) for system in matrix["system"]) for kind in kinds)
        assert matrix["python"][0] == oldest
        assert len(matrix["python"]) > 1
    scripts = [step.get("run", "") for job in jobs.values() for step in job["steps"]]
    for script in (".ci/run", ".ci/versions python3.11 python3.13"):
        assert script in scripts
        assert os.access(ROOT / script.split()[0], os.X_OK)


FOREIGN = r"secrets\.|password|://|index-url|pypi|conda|\btoken\b"


def test_workflows_hold_no_secret_and_name_no_registry():
    for path in WORKFLOW.parent.glob("*.yml"):
        text = path.read_text(encoding="utf-8")
        assert re.findall(FOREIGN, text, re.I) == []
        assert loaded(path)["permissions"] == {"contents": "read"}
        used = re.findall(r"uses: (\S+)", text)
        assert {name for name in used if not re.fullmatch(r"actions/[\w-]+@v\d+", name)} == set()
    assert re.findall(FOREIGN, "pip install --index-url https://a/simple", re.I)  # the control


def test_hooks_check_what_ci_checks():
    """With the same tools: ruff's rules are those of pyproject.toml, which no hook overrides."""
    hooks = loaded(ROOT / ".pre-commit-config.yaml")["repos"][0]["hooks"]
    entries = {hook["entry"].split(" --force")[0] for hook in hooks}
    run = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    checked = re.findall(r"^\$bin/(ruff \w+(?: --check)?|mypy)", run, re.M)
    assert entries == {"python -m mypy" if name == "mypy" else name for name in checked}
    assert len(checked) == 3
    assert not any(re.search("--config|--select", hook["entry"]) for hook in hooks)
    pinned = {pin for hook in hooks for pin in hook.get("additional_dependencies", [])}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert len(pinned) == 1
    assert pinned <= {*project["project"]["optional-dependencies"]["test"]}


def test_one_version_is_said_everywhere():
    project = re.search(r'^version = "(.*)"', (ROOT / "pyproject.toml").read_text(), re.M)[1]
    cited = loaded(ROOT / "CITATION.cff")
    assert str(cited["version"]) == project
    headings = re.findall(r"^## .*", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert headings[:2] == ["## [Unreleased]", f"## [{project}] - {cited['date-released']}"]


NAMED = re.compile(r"`((?:\w+/)*)(\w+)\.(?:py\b)?(\w*)`")  # a module, or a name in it


def missing(text):
    """Return what a text names that is not in the house: a module, or a name in a module."""
    found = []
    for folder, module, name in NAMED.findall(text):
        at = f"{folder.removeprefix('seqopt/')}{module}"
        paths = [
            p for room in ("seqopt", "formulations", "") for p in (ROOT / room).glob(f"{at}.py")
        ]
        paths += (ROOT / "seqopt").glob(f"*/{at}.py") if not paths else []
        if not any(re.search(rf"\b{name}\b", path.read_text(encoding="utf-8")) for path in paths):
            found.append(f"{at}.{name}")
    return found


def test_the_architecture_names_what_exists():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text[text.index("## Where something new goes") :]
    assert len(NAMED.findall(table)) >= 20
    assert missing(table) == []
    wrong = "`registry.NO_ENGINES` `seqopt/engines/gone.py` `registry.ENGINES`"
    assert missing(wrong) == ["registry.NO_ENGINES", "engines/gone."]


OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
ELSEWHERE = r"pip|uv |sphinx|pytest|experiments|pre-commit|npx|ruff|LMGC90|weigh"


def unknown(text, known):
    """Return the options of seqopt in a text that no command has."""
    lines = [line for line in text.splitlines() if not re.search(ELSEWHERE, line)]
    return {option for line in lines for option in OPTION.findall(line)} - known


def test_pages_name_options_that_commands_have(capsys):
    helps = [command(capsys, name, "--help")[1] for name in COMMANDS]
    known = {*OPTION.findall(" ".join(helps))}
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    texts = {str(page): page.read_text(encoding="utf-8") for page in pages}
    assert {name: lost for name, text in texts.items() if (lost := unknown(text, known))} == {}
    assert unknown("`seqopt optimize --placing --out plan`", known) == {"--placing"}  # the control
