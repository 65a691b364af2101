"""The command line: ``seqopt compare | analyze | optimize | assess | scene``.

`seqopt.cli.main.main` runs a command as the shell does and returns its exit status: 0, 2 where the
user must act, 3 where a solver failed. `seqopt.cli.arguments` has the arguments and their help,
`seqopt.cli.values` what they stand for. The room exports nothing, so that ``seqopt.cli.main``
stays the module.

>>> from seqopt.cli.main import main
>>> main(["scene", "arch25"])  # doctest: +ELLIPSIS
arch25: 25 bricks, 24 joints, 2 ground ends
...
0
"""

__all__: list[str] = []
