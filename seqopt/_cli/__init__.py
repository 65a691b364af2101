"""The command line: ``seqopt compare | optimize | pareto | analyze | assess | report | …``.

`seqopt._cli.main.main` runs a command as the shell does and returns its exit status. The package
exports nothing, so that ``seqopt._cli.main`` stays the module.
"""
