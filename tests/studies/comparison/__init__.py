"""The comparison of controllers by a registered plan: its runs, its judgement, its page."""
