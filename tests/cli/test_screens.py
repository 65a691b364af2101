"""Help; what a person sees."""

import io
import os
import re
import sys
import threading

import pytest

from seqopt._cli import watcher
from seqopt._cli.arguments import EXAMPLES, parser
from seqopt._cli.main import main
from seqopt._cli.registry import COMMANDS
from seqopt._cli.signatures import signature_of
from seqopt._cli.terminal import complain, show_text
from seqopt._cli.watcher import Watcher
from seqopt.errors import ProblemError
from seqopt.work import Stage


@pytest.fixture
def printed(capsys, monkeypatch):
    """What a command prints on a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")

    def run(*words):
        assert main(words) == 0
        return capsys.readouterr().out

    return run


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_every_option_once_and_examples_on_lines_of_their_own(printed, name):
    out = printed(name, "--help")
    assert max(map(len, out.splitlines())) <= 80
    command = parser(name)._subparsers._group_actions[0].choices[name]
    about = "\n".join(group.description or "" for group in command._action_groups)
    said = {line.strip() for line in about.splitlines()}
    kept = [line for line in out.splitlines() if line.strip() not in said]
    lines = "\n".join(kept).partition("\nexample")[0].splitlines()
    begun = (line[2:].split()[0] for line in lines if line[:2] == "  " and line[2:3] > " ")
    body = [word.rstrip(",") for word in begun]
    for action in command._actions:
        flag = (action.option_strings or [action.metavar])[0]
        assert flag is None or body.count(flag) == 1, flag
    examples = signature_of(COMMANDS[name].load()).examples
    assert [example for example in examples if f"\n  {example}\n" not in out] == []


def test_help_lists_names_of_criteria_formulations_and_formats(printed):
    said = " ".join(printed("optimize", "--help").split())
    assert re.search(r"names: .*worst-ratio, .*names: .*cascade, ", said)
    assert "; names: tasks, tasks_csv, compas_assembly" in " ".join(
        printed("export", "--help").split()
    )


def test_help_without_a_command_fits_one_screen(printed):
    lines = printed("--help").splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80


def test_numbers_are_read_where_they_are_given():
    """At once: no command meets one that is wrong."""
    options = signature_of(COMMANDS["assess"].load()).options
    found = [options[name].parse(value) for name, value in (("workers", "2"), ("friction", "0"))]
    assert found == [2, 0.0]
    for wrong in ({"workers": "0"}, {"workers": "two"}, {"friction": "x"}, {"friction": "-1"}):
        with pytest.raises(ProblemError, match=r"^--(workers|friction)"):
            [options[name].parse(value) for name, value in wrong.items()]


@pytest.mark.slow
def test_the_payload_that_is_said_to_be_enough_is(capsys):
    words = ["optimize", "arch25", "--robots", "2", "--no-stability"]
    assert main(words) == 0
    out = capsys.readouterr().out
    least = int(out.partition("payload of ")[2].partition("--payload ")[2].partition(",")[0])
    for newton, over in ((least, False), (least - 1, True)):
        assert main([*words, "--payload", str(newton)]) == 0
        assert ("payload exceeded" in capsys.readouterr().out) is over


def test_a_mesh_is_answered_by_the_command_that_imports_it(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my wall.obj").write_text("v 0 0 0", encoding="utf-8")
    assert main(["optimize", "my wall.obj"]) == 2
    said = "seqopt import 'my wall.obj' --unit m --density 2400 --out 'my wall.json'"
    assert said in capsys.readouterr().err


def test_without_words_it_shows_three_examples_that_are_commands(capsys):
    assert main([]) == 0
    out, err = capsys.readouterr()
    assert (out, err) == (EXAMPLES, "")
    commands = re.findall(r"^  seqopt (.*)$", EXAMPLES, re.M)
    assert len(commands) == 3
    for command in commands:
        parser().parse_args(command.split())


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("optimise", "optimize"),
        ("analyze --method sequentiel", "sequential"),
        ("scene arch:spn=2", "span"),
        ("scene wal:columns=3", "wall"),
        ("optimize --formlation beam", "--formulation"),
        ("optimize --schedule free --formulation schedule_serch --out x", "schedule_search"),
        ("optimize --schedule free --rule newst=free --out x", "newest"),
        ("optimize --schedule free --rule newest=fre --out x", "free"),
        ("optimize --formulation beam --option widht=3 --out x", "width"),
        ("optimize --formulation beam --limit F_larges=3 --out x", "F_largest"),
        ("optimize --formulation beam --criterion t_max --out x", "T_max"),
        ("optimize --robust worst-peak --vary stifness=2 --out x", "stiffness"),
        ("pareto chain:bricks=7 --aim D_mx --out x", "D_max"),
        ("import a.obj --unit mmm --out x", "mm"),
    ],
)
def test_the_word_that_was_meant_is_named(capsys, monkeypatch, tmp_path, words, meant):
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    err = capsys.readouterr().err
    assert f"(did you mean {meant}?)" in err
    assert err.count("\n") == 1


def test_nothing_is_named_where_nothing_is_near(capsys):
    assert main(["qqqq"]) == 2
    assert "did you mean" not in capsys.readouterr().err
    assert main(["compare", "--qqqq"]) == 2
    assert "did you mean" not in capsys.readouterr().err


def test_every_example_of_help_can_be_parsed():
    for name, command in COMMANDS.items():
        examples = signature_of(command.load()).examples
        assert len(examples) >= 1
        for example in examples:
            assert parser(name).parse_args(example.split()[1:]).command == name


# what a person sees: progress that goes away, lines that fit, colors that are not needed


posix = pytest.mark.skipif(os.name != "posix", reason="terminals are POSIX's")


class Screen(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self):
        return True


def on_screen(monkeypatch):
    """A terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")
    stream = Screen()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(sys, "stdout", stream)
    return stream


@pytest.fixture
def patient(monkeypatch):
    """A watcher that shows at once what it was told, and often."""
    monkeypatch.setattr(watcher, "PATIENCE", 0.0)
    monkeypatch.setattr(watcher, "TICK", 0.01)


def left_on(text):
    """The line that a terminal shows in the end."""
    line = ""
    for part in re.split(r"(\r|\033\[K)", text):
        if part == "\r":
            at = 0
        elif part == "\033[K":
            line = line[:at]
        else:
            line = line[: at if line else 0] + part + line[len(part) :]
    return line.strip()


def test_a_stage_shows_share_and_time_left_and_fits_the_terminal(monkeypatch):
    on_screen(monkeypatch)
    tell = Watcher()
    tell(Stage("responses", 0.25, 12.0))
    assert tell.line() == "responses … 25 %, 12 s left"
    tell("writing the plan")
    assert tell.line() == "writing the plan … 0 s so far"
    tell("b" * 300 + "\033[2J")
    assert len(tell.line()) <= 80
    tell("b\033[2J")
    assert "\033" not in tell.line()


def test_the_time_left_of_a_stage_is_that_of_its_own_work(monkeypatch):
    on_screen(monkeypatch)
    now = [100.0]
    monkeypatch.setattr(watcher.time, "perf_counter", lambda: now[0])
    tell = Watcher()
    for now[0], told, said in (
        (110.0, Stage("steps", 0.0), "10 s so far"),
        (120.0, "between", "20 s so far"),
        (120.0, Stage("steps", 0.25), "25 %, 30 s left"),
        (121.0, Stage("steps", 0.1), "21 s so far"),  # it begins anew
        (122.0, Stage("steps", 0.5), "50 %, 1 s left"),
    ):
        tell(told)
        assert said in tell.line()


class Seen(Screen):
    """A terminal, and a mark of when something was shown on it."""

    def __init__(self):
        super().__init__()
        self.shown = threading.Event()

    def write(self, text):
        if "responses" in text:
            self.shown.set()
        return super().write(text)


class Cell(Seen):
    """Standard error as a notebook has it."""

    pub_thread = None

    def isatty(self):
        return False


@pytest.mark.parametrize("kind", [Seen, Cell])
def test_it_is_shown_now_and_then_and_goes_away_also_with_an_error(patient, monkeypatch, kind):
    monkeypatch.setattr(sys, "stderr", stream := kind())

    def fail():
        with Watcher() as tell:
            for share in range(2000):
                tell(Stage("responses", share / 2000, 12.0))
            assert stream.shown.wait(60)
            raise ValueError("spoilt")

    with pytest.raises(ValueError, match="spoilt"):
        fail()
    assert 0 < stream.getvalue().count("responses") < 1000  # not for each of what it was told
    assert left_on(stream.getvalue()) == ""


def test_long_lines_are_wrapped_for_people_only(monkeypatch):
    screen = on_screen(monkeypatch)
    complain("seqopt: error: " + "word " * 40)
    complain("engine: " + "word " * 40)
    show_text("word " * 40)
    seen = re.sub(r"\033\[[0-9;]*[mK]", "", screen.getvalue())
    assert max(map(len, seen.splitlines())) <= 80
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    complain("seqopt: error: " + "word " * 40)
    assert sys.stderr.getvalue().count("\n") == 1
