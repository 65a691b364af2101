"""The command line: ``seqopt compare | optimize | pareto | analyze | assess | report | …``.

`seqopt._cli.main.main` runs a command as the shell does and returns its exit status, a
`seqopt._cli.answer.Status`. `seqopt._registry.COMMANDS` names the commands. Each is a function
whose signature and docstring say its options (`seqopt._cli.signatures`); it returns a
`seqopt._cli.answer.Answer`, printed as text, as the paths of written files, or as JSON. The package
exports nothing, so that ``seqopt._cli.main`` stays the module.

>>> from seqopt._cli.main import main
>>> int(main(["scene", "arch25"]))  # doctest: +ELLIPSIS
arch25: 25 bricks, 24 joints, 2 ground ends
...
0
"""

__all__: list[str] = []
