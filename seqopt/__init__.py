"""Find where each robot should hold a half-built structure, over the whole build.

``seqopt.scene`` says what is built, ``seqopt.compliance`` how every partial structure answers any
grips, ``seqopt.methods`` how a build goes, ``seqopt.responses`` and ``seqopt.compare`` what it
costs. Names are imported from the module that defines them.
"""
