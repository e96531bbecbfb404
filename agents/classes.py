"""What the critics share that tell the distribution of what is earned: its bins, how a network is fitted, and kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np

from sledenv.machine.extras import needs

with needs("agents", __name__):
    import torch
    from torch import nn
    from torch.optim.swa_utils import AveragedModel


_SMEAR: Final = 0.75  # standard deviation of a target, in bins: Farebrother et al., "Stop Regressing", 2024


class Bins(nn.Module):
    """Classes of what is earned: a regression would smooth the cliffs, beside which the best often lies.

    Parameters
    ----------
    low, high : float
        Ends of their range, in which the smeared targets lie.
    count : int
    """

    edges: torch.Tensor
    middles: torch.Tensor

    def __init__(self, low: float, high: float, count: int) -> None:
        super().__init__()
        edges = torch.linspace(low, high, count + 1)
        self.register_buffer("edges", edges, persistent=False)
        self.register_buffer("middles", 0.5 * (edges[1:] + edges[:-1]), persistent=False)

    def loss(self, logits: torch.Tensor, earned: torch.Tensor) -> torch.Tensor:
        """Return the mean cross-entropy of logits, (n, bins), against what was earned, (n,).

        Each target is a narrow normal distribution (HL-Gauss).
        """
        deviation = _SMEAR * (self.edges[1] - self.edges[0])
        below = torch.special.ndtr((self.edges - earned[:, None]) / deviation)
        return nn.functional.cross_entropy(logits, below.diff(dim=1))

    def expected(self, logits: torch.Tensor) -> torch.Tensor:
        """Return what is expected, (...), by logits of shape (..., bins)."""
        return logits.softmax(dim=-1) @ self.middles


class Fit:
    """Gradient steps of a critic, with a rate that falls to 0 as a cosine, and the weights averaged over the last ones.

    Parameters
    ----------
    critic : Module
    learning_rate : float
        At first.
    steps : int
        How many there will be.
    average : callable
        Moves averaged weights towards those of a step, see :class:`torch.optim.swa_utils.AveragedModel`.
    """

    def __init__(self, critic: nn.Module, learning_rate: float, steps: int, average: Callable[..., Any]) -> None:
        self._critic = critic
        self._optimiser = torch.optim.AdamW(critic.parameters(), learning_rate, weight_decay=1e-4, fused=True)
        self._schedule = torch.optim.lr_scheduler.CosineAnnealingLR(self._optimiser, steps)
        self._average = AveragedModel(critic, multi_avg_fn=average)

    @property
    def averaged(self) -> Any:
        """The critic with averaged weights."""
        return self._average.module

    def step(self, loss: torch.Tensor) -> None:
        """Take the gradient step of a loss."""
        self._optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self._optimiser.step()
        self._schedule.step()
        self._average.update_parameters(self._critic)


def keep(critic: nn.Module, path: Path) -> None:
    """Write a critic as plain arrays of half precision: nothing that could run when it is read."""
    arrays = {name: value.numpy().astype(np.float16) for name, value in critic.state_dict().items()}
    np.savez_compressed(path, **arrays)


def kept_weights(path: Path) -> dict[str, torch.Tensor]:
    """Read what :func:`keep` wrote.

    Raises
    ------
    ValueError
        If the file cannot be read, or a weight is no finite number: whatever is rated by it would be the first that is
        tried.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            state = {name: torch.from_numpy(arrays[name].astype(np.float32)) for name in arrays.files}
    except (OSError, EOFError, ValueError, BadZipFile) as error:
        raise ValueError(f"{path} cannot be read: {error}") from error
    wrong = [name for name, value in state.items() if not value.isfinite().all()]
    if wrong:
        raise ValueError(f"{path}: {wrong[0]} has weights that are no finite numbers")
    return state
