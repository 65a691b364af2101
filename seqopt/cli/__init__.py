"""The command line: ``seqopt compare | analyze | optimize | assess | scene``.

`seqopt.cli.main.main` runs a command as the shell does and returns its exit status, as
`seqopt.cli.status` lists them. `seqopt.cli.arguments` has the arguments and their help,
`seqopt.cli.values` what they stand for, `seqopt.cli.terminal` what is printed. The room exports
nothing, so that ``seqopt.cli.main`` stays the module.

>>> from seqopt.cli.main import main
>>> int(main(["scene", "arch25"]))  # doctest: +ELLIPSIS
arch25: 25 bricks, 24 joints, 2 ground ends
...
0
"""

__all__: list[str] = []
