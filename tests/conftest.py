"""Settings of all tests."""

from hypothesis import settings

settings.register_profile("sledenv", deadline=None)  # how fast an example is depends on what else the machine does
settings.load_profile("sledenv")
