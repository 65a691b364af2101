"""Compiled graphs that stand alone: read without a scene, written for any solver, judged anywhere.

>>> import seqopt
>>> problem = seqopt.optimize("chain:bricks=7", "free", aim="minmax,steps").problem
>>> instance = seqopt.compile_instance(problem, below=40.0)
>>> plan = seqopt.solve(instance)
>>> seqopt.judge_instance(instance, plan.nodes).gap
0.0

Files hold the graph and what is asked of its paths (`seqopt.save_instance`, `seqopt.read_instance`);
MPS and LP files hold it as an integer program.
"""
