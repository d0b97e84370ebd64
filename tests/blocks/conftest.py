"""Settings of hypothesis: a busy machine makes no test fail."""

from hypothesis import settings

settings.register_profile("patient", deadline=None)
settings.load_profile("patient")
