"""The documentation: built strictly, tutorials executed; the README's commands are real."""

import re
import shutil
import subprocess
import sys
from itertools import product

import pandas as pd
import pytest

import seqopt
from experiments.harness.results import RESULTS, stored, two
from experiments.placement.formulations import CUT, QUESTIONS
from seqopt._cli.registry import COMMANDS
from seqopt.graph.formulation import exhibits, formulations
from seqopt.study import STEP_TABLES, printed_steps
from tests.browser import PLAIN, browsed, browses
from tests.builders import ROOT
from tests.docs.extensions import stated
from tests.docs.site import broken, megabytes, sizes, words
from tests.docs.transcripts import PAGES

STATED = stated()


def build(source, target):
    """Build a site with warnings as errors."""
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    return subprocess.run([*command, source, target], capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_site_builds_strictly(tmp_path):
    done = build(ROOT / "docs", tmp_path / "html")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "html" / "tutorials" / "reference_arch.html").read_text(encoding="utf-8")
    assert "306.5" in page  # a number that only the executed tutorial prints
    assert re.search(r'alt="What the code above draws, under the heading: \w', page)
    assert "<msup>" in (tmp_path / "html" / "mechanics.html").read_text(encoding="utf-8")
    page = (tmp_path / "html" / "formulations" / "index.html").read_text(encoding="utf-8")
    assert f"On {STATED['arches']} random arches" in " ".join(page.split())
    assert page.count("<table") >= 4
    assert broken(tmp_path / "html") == []
    assert too_much(tmp_path / "html") == []
    search = (tmp_path / "html" / "search.html").as_uri()
    if browses():
        assert "faq.html" in found(tmp_path, f"{search}?q=infeasible")
        assert ".html" not in found(tmp_path, f"{search}?q=zzzz")  # the control


LOOKED_UP = ("api/", "changelog", "command_line", "glossary")  # nobody reads these from the top


def too_much(site):
    """Return what of a site is more than a reader should meet."""
    every = sizes(site)
    found = [
        f"{name}: {told:,} words in sentences"
        for name, (_, told) in every.items()
        if told > 1_500 and not name.startswith(LOOKED_UP)
    ]
    total = sum(count for count, _ in every.values())
    bounds = {"pages": (len(every), 45), "words": (total, 85_000), "MB": (megabytes(site), 15)}
    return found + [f"{n:,.0f} {what}" for what, (n, most) in bounds.items() if n > most]


def test_words_of_a_page_are_those_that_are_read(tmp_path):
    main = (
        "<article><p>one two</p>\n<table><td>three</td></table>\n<script>x = 1</script></article>"
    )
    assert words(f"<nav>a b</nav>{main}<p>after</p>") == (3, 2)
    (tmp_path / "long.html").write_text(f"<article>{'word ' * 1_501}</article>")
    (tmp_path / "glossary.html").write_text(f"<article>{'word ' * 1_501}</article>")
    assert too_much(tmp_path) == ["long.html: 1,501 words in sentences"]


def found(folder, search):
    """Return the list of what a search finds; the sidebar around it has every page."""
    page, _ = browsed(folder, search, PLAIN)
    return re.search(r'id="search-results".*?<ul(.*?)</ul>', page, re.S)[1]


def build_page(folder, text):
    """Build a site of one executed page with the settings of the documentation."""
    source = folder / "docs"
    source.mkdir()
    shutil.copy(ROOT / "docs" / "conf.py", source)
    for part in ("extensions", "_static"):
        shutil.copytree(ROOT / "docs" / part, source / part)
    front = "---\nfile_format: mystnb\nkernelspec:\n  name: python3\n---\n"
    (source / "index.md").write_text(f"{front}# Page\n\n{text}\n", encoding="utf-8")
    return build(source, folder / "html")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flaw", "said"),
    [
        (
            "[lost](nowhere.md)\n\n{term}`gone`\n\n" + r"$\frac{1}$",
            ["index.md", "nowhere.md", "gone", "cannot become MathML"],
        ),
        ("```{code-cell}\nassert 1 == 2\n```", ["index.md"]),
    ],
)
def test_a_flaw_fails_the_build(tmp_path, flaw, said):
    done = build_page(tmp_path, flaw)
    assert done.returncode != 0
    assert [text for text in said if text not in done.stderr] == []


def test_readme_shows_two_commands_that_exist():
    """What the first prints is tested with the command line."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = re.findall(r"```sh\n(.*?)\n```", text, flags=re.DOTALL)
    assert len(commands) >= 2
    assert commands[0].endswith("seqopt compare")
    assert commands[1].endswith('-m pytest -n auto -m "not slow"')
    assert "compare" in COMMANDS


def test_pictures_exist_and_no_number_is_missing():
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        if "_build" in page.parts:
            continue
        text = page.read_text(encoding="utf-8")
        names = [] if page.name == "README.md" else [*STATED]
        assert text.count("{{") == sum(text.count(f"{{{{ {name} }}}}") for name in names), page
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text):
            assert (page.parent / target).exists(), f"{page}: {target}"


SHOWN = {
    "arch": "- The reference arch",
    "soft": "The same arch with soft grips",
    "dry": "The same arch laid dry",
    "vault": "A barrel vault of 46 blocks",
    "wall": "A wall of 12 bricks",
}  # what the README calls the scenes of its chart


def readme_figures():
    """What the README states of stored rows, and where a change of either would show."""
    speed = pd.read_csv(RESULTS / "engine_speed.csv", index_col=0)["value"]
    errors = pd.read_csv(RESULTS / "identify_arch25_refit.csv").set_index("what")["shipped"]
    largest = pd.read_csv(RESULTS / "witnesses.csv").set_index("case").loc["armadillo_cra"]
    own = [errors[f"{what}_pct"] for what in ("median", "p90", "p95")]
    other = [errors[f"Table B.1, {what}_pct"] for what in ("median", "p90", "p95")]
    return {
        "".join(rf"{scene}: (Take .+?\.) (?:- )?" for scene in SHOWN.values()): [
            STATED[f"take_{name}"] for name in SHOWN
        ],
        r"is ([\d,]+) times as fast in the median of five rounds \(([\d,]+) in the lowest\)": [
            two(speed["ratio_median"]),
            two(speed["ratio_lowest"]),
        ],
        r"median ([\d.]+) %, 90th percentile ([\d.]+) %, 95th ([\d.]+) %": [
            f"{value:.2f}" for value in own
        ],
        r"which took no part: ([\d.]+), ([\d.]+) and ([\d.]+) %": [
            f"{value:.2f}" for value in other
        ],
        r"takes ([\d.]+) s for (\d+) blocks": [f"{largest['seconds']:.1f}", str(largest["blocks"])],
    }


@pytest.mark.parametrize(("pattern", "figures"), readme_figures().items())
def test_readme_states_what_is_stored(pattern, figures):
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    found = re.search(pattern, text)
    assert found, pattern
    assert [*found.groups()] == figures


def test_the_page_counts_what_the_printed_tables_have():
    """Why they are no reference of the chart of speed against regret."""
    printed = set()
    for table in map(printed_steps, STEP_TABLES):
        nodes = table.filter(regex="^rob._node$").to_numpy(float)
        printed |= {
            (int(bricks), frozenset(own[own > 0].astype(int).tolist()))
            for bricks, own in zip(table["bricks"], nodes, strict=True)
        }
    engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    loop, choices = seqopt.three_robot_loop(engine.network), set()
    for step in loop.steps:
        given = [grip for grip in step.grips if isinstance(grip, int)]
        for nodes in product(*(loop.moves[move].candidates for move in step.moves)):
            if step.moves and len({*given, *nodes}) == len(given) + len(nodes):
                choices.add((step.bricks, frozenset((*given, *nodes))))
    among = f"Of the {len(choices):,} that the loop chooses among they have"
    found = [f"{len(printed)} different sets of grips", f"{among} {len(printed & choices)},"]
    ways = {  # of the loop by ranks, where no other plan is as good
        "90 steps of its best plan by ranks": (loop, "equations-2-3", ()),
        "48 of the best free schedule": (seqopt.FreeRules(), "worst-ratio", "minmax,steps"),
    }
    for text, (moves, criterion, aims) in ways.items():
        plan = seqopt.solve(seqopt.pose(engine, moves, seqopt.CRITERIA[criterion], aims))
        known = sum((step.bricks, frozenset(step.held)) in printed for step in plan.steps)
        assert text.startswith(f"{len(plan.steps)} ")
        found.append(f"of the {text} {known}")
    page = (ROOT / "docs/tutorials/speed_and_accuracy.md").read_text(encoding="utf-8")
    page = " ".join(page.split())
    assert [each for each in found if each not in page] == []


def test_readme_in_words_what_is_stored():
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"chosen for rigid grips are {STATED['rigid_grips_regret']} worse" in text
    speed = pd.read_csv(RESULTS / "engine_speed.csv", index_col=0)["value"]
    assert f"of {round(1 / speed['fast_s_per_set'], -4):,.0f} three-grip sets a second" in text
    assert f"is {round(speed['ratio_median'], -2):,.0f} times as fast in the median" in text
    assert f"({round(speed['ratio_lowest'], -1):.0f} in the lowest)" in text


QUICK = ("engines", "scenes")  # pages whose examples are among the quick tests


def examples():
    """Python blocks of the documentation that are followed by the output they print."""
    pattern = re.compile(r"```python\n(.*?)```\n\n```text\n(.*?)```", flags=re.DOTALL)
    pages = {*(ROOT / "docs").rglob("*.md")} - {ROOT / "docs" / f"{name}.md" for name in PAGES}
    for page in sorted(pages):
        for number, match in enumerate(pattern.finditer(page.read_text(encoding="utf-8"))):
            marks = [] if page.stem in QUICK else pytest.mark.slow
            yield pytest.param(*match.groups(), id=f"{page.stem}-{number}", marks=marks)


@pytest.mark.parametrize(("code", "printed"), [*examples()])
def test_examples_print_what_they_show(code, printed, capsys):
    exec(compile(code, "example", "exec"), {})
    assert capsys.readouterr().out.strip() == printed.strip()


def test_every_formulation_is_compared_on_every_question():
    rows = stored("formulations")
    least = rows[rows["bricks"] == rows["bricks"].min()]
    for question, own in least[least["formulation"] != CUT].groupby("question"):
        assert sorted(own["formulation"]) == sorted([*formulations(), *exhibits()]), question
    assert {*least["question"]} == {*QUESTIONS}
    told = STATED["refused_table"]
    for name in ("pareto_zones", "makespan_labels"):
        assert f"`{name}`" in told
    assert "`overlap_dp`" not in told


def test_every_formulation_has_its_program_and_is_in_the_example():
    page = (ROOT / "docs" / "formulations" / "programs.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##)", page, re.M | re.S))
    for name in formulations("costs"):
        assert len(sections[name].split()) > 20, name
        assert re.search(rf"^{name} +\d", page, re.M), name
