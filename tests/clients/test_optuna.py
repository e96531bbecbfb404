"""The sweep with Optuna: its best trial is judged on held-out contexts."""

from __future__ import annotations

import pytest

pytest.importorskip("optuna")

from examples import optuna_sweep


def test_a_small_sweep_judges_the_best_trial(capsys):
    reward = optuna_sweep.main(["--trials", "4", "--updates", "2"])
    assert 0.0 < reward < 1.0
    said = capsys.readouterr().out
    assert "best settings: {'learning_rate'" in said
    assert f"on 200 test contexts {reward:.3f}" in said
