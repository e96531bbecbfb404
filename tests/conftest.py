"""Settings of all tests, and what they say at the end."""

from collections import Counter

import pytest
from hypothesis import settings

settings.register_profile("sledenv", deadline=None)  # how fast an example is depends on what else the machine does
settings.load_profile("sledenv")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say why tests were skipped: one line for each reason."""
    skipped = (report.longrepr for report in terminalreporter.stats.get("skipped", []))
    reasons = Counter(told[2].removeprefix("Skipped: ") for told in skipped if isinstance(told, tuple))
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"{count} skipped: {reason}")
