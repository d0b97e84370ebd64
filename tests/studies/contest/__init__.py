"""Controllers of case C, tuned alike and compared: ``python -m tests.studies.contest``."""
