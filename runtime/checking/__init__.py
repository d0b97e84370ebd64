"""A checker for users' own blocks: does a block follow the rules that a run relies on?

In goes one block, out comes nothing, an error that names the broken rule, or a warning for each
method that the compiled engine calls from Python::

    check_block(Backlash(width=0.2))
"""

from runtime.checking.check import CheckError, NotCompiledWarning, NotCopiedWarning, check_block
