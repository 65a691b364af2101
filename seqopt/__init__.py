"""Find where each robot should hold a half-built structure, over the whole build.

``seqopt.scene.scene`` says what is built, ``seqopt.engines.rigid.compliance`` how every partial structure answers any
grips, ``seqopt.sequence.two_robots`` how a build goes, ``seqopt.responses.table`` and ``seqopt.report.comparison`` what it
costs. Names are imported from the module that defines them.
"""
