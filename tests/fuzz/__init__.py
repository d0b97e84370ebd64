"""Fuzzers: random input, and what must hold whatever the input is.

Each module with a function ``run(examples, seed)`` is a subject. ``test_fuzz.py`` tries a modest
number of examples of each; ``python -m tests.fuzz SUBJECT --examples N`` tries any number.
"""
