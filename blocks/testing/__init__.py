"""blocks.testing."""

from blocks.testing.checking import CheckError, check_block

__all__ = ["CheckError", "check_block"]
