"""Settings of all tests, and what they say at the end."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import settings

from sledenv.compiler.entries import INTERPRETED

# How fast an example is depends on what else the machine does. The fast suite tries few examples of each property, the
# slow one (-m slow) many.
settings.register_profile("few", deadline=None, derandomize=True, max_examples=25)
settings.register_profile("many", deadline=None, derandomize=True, max_examples=500)


def pytest_configure(config: pytest.Config) -> None:
    """Choose how many examples are tried."""
    settings.load_profile("many" if config.option.markexpr == "slow" else "few")
    if INTERPRETED:
        np.seterr(over="ignore")  # as compiled: a kernel overflows without a word


@pytest.hookimpl(tryfirst=True)  # before those are left out that are not slow
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Make properties slow tests too where slow tests run."""
    for item in items:
        if config.option.markexpr == "slow" and getattr(getattr(item, "function", None), "is_hypothesis_test", False):
            item.add_marker("slow")


def pytest_terminal_summary(terminalreporter: "pytest.TerminalReporter") -> None:
    """Say why tests were skipped: one line for each reason."""
    skipped = (report.longrepr for report in terminalreporter.stats.get("skipped", []))
    reasons = Counter(told[2].removeprefix("Skipped: ") for told in skipped if isinstance(told, tuple))
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"{count} skipped: {reason}")
