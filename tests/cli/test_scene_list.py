"""Built-in scenes on the command line: all are named, and every one is described and exported."""

from __future__ import annotations

import pytest

from seqopt._cli.main import main
from seqopt.scene.scene_file import ABOUT, KINDS, builtin_scenes, load_scene


def test_all_built_in_scenes_are_listed_a_line_each(capsys):
    assert main(["scene", "--list"]) == 0
    out, err = capsys.readouterr()
    count = len(builtin_scenes())
    lines, words = out.splitlines()[:count], out.splitlines()[count:]
    assert words == [*KINDS.values()]
    assert err == ""
    assert [line.split(":")[0] for line in lines] == [*builtin_scenes()]
    assert {"arch25", "dome163", "vault338"} <= {*builtin_scenes()}
    for line, name in zip(lines, builtin_scenes(), strict=True):
        scene = load_scene(name)
        assert f"{len(scene.bricks)} bricks, {len(scene.joints)} joints" in line
        assert line.endswith(ABOUT[name])


def test_a_list_and_an_export_are_two_things(capsys, tmp_path):
    path = tmp_path / "x.json"
    assert main(["scene", "--list", "--export", str(path)]) == 2
    assert "not allowed with argument" in capsys.readouterr().err
    assert not path.exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_scenes())
def test_a_built_in_scene_is_exported_and_read_again(capsys, tmp_path, name):
    path = tmp_path / "scene.json"
    assert main(["scene", name, "--export", str(path)]) == 0
    assert f"{name}: {len(load_scene(name).bricks)} bricks" in capsys.readouterr().out
    assert load_scene(path) == load_scene(name)
