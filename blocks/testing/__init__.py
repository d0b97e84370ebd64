"""A checker for users' own blocks: does a block follow the rules that a run relies on?"""

from blocks.testing.checking import CheckError, NotCompiledWarning, check_block

__all__ = ["CheckError", "NotCompiledWarning", "check_block"]
