"""The command ``scene``: check, describe and export a scene, or list those that there are."""

from __future__ import annotations

from typing import Annotated

from seqopt._cli.answer import Answer, scene_facts
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt.arms._model import unread_models
from seqopt.exchange._files import Output
from seqopt.network._words import network_facts, scene_lines
from seqopt.network.network import build_network
from seqopt.scene.scene_file import ABOUT, KINDS, builtin_scenes, find_scene, load_scene, save_scene
from seqopt.work import Tell, with_progress


def run(
    asked: Annotated[Call, ("call", find_scene)],
    *,
    progress: Tell,
    list: bool = False,  # noqa: A002  # the option's name
    export: File = None,
) -> Answer:
    """Check a scene, say what is in it, and write it as a JSON file if asked.

    Or list all built-in scenes and the words that make others.

    Parameters
    ----------
    list : bool, optional
        Name all built-in scenes, and the words that make others.
    export : pathlib.Path, optional
        JSON file to write.

    Examples
    --------
    $ seqopt scene --list
    $ seqopt scene arch:span=2,rise=0.8
    $ seqopt scene arch25 --export my.json
    """
    if list:
        names = with_progress("reading built-in scenes", builtin_scenes(), progress)
        every = {name: load_scene(name) for name in names}
        sizes = {n: f"{len(s.bricks)} bricks, {len(s.joints)} joints" for n, s in every.items()}
        listed = [f"{name}: {size}; {ABOUT[name]}" for name, size in sizes.items()]
        scenes = [{**scene_facts(scene), "about": ABOUT[name]} for name, scene in every.items()]
        return Answer({"scenes": scenes, "kinds": KINDS}, "\n".join([*listed, *KINDS.values()]))
    Output(export, asked.words.get("scene")).keep_apart(export)
    found = asked()
    facts = {**scene_facts(found), **network_facts(build_network(found))}
    lines = [*scene_lines(found, facts)]
    if export is not None:
        save_scene(found, export)
        lines.append(f"written to {export}")
    written = () if export is None else (export,)
    return Answer({"scene": facts}, "\n".join(lines), written=written, notes=unread_models(found))
