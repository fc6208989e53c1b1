"""The set network: all windows of one camera in, one offset from the prior pose out."""

import torch
from torch import Tensor, nn

from models.regression.set_features import FEATURES

_WIDTH = 96
_POOLED = 64
_HEADS = 4
_MOST_LOG_COUNT = 4.6  # a set of 100: what training shows
_LEAST_LOG_SD, _MOST_LOG_SD = -5.0, 2.0


class SetNetwork(nn.Module):
    """Windows apart, then pooled by mean, spread and a learned weight, then together.

    Source of the idea: Zaheer et al. 2017, "Deep Sets", section 3 (sums over members make a
    function of a set); the weights are a softmax over members.
    """

    centre: Tensor
    spread: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(FEATURES))
        self.register_buffer("spread", torch.ones(FEATURES))
        self.window = nn.Sequential(
            nn.Linear(FEATURES, _WIDTH), nn.SiLU(),
            nn.Linear(_WIDTH, _WIDTH), nn.SiLU(),
            nn.Linear(_WIDTH, _POOLED + _HEADS),
        )  # fmt: skip
        self.together = nn.Sequential(
            nn.Linear(2 * (_POOLED * (2 + _HEADS) + 1), 192), nn.SiLU(),
            nn.Linear(192, 128), nn.SiLU(),
            nn.Linear(128, 6),
        )  # fmt: skip

    def forward(
        self, seen: Tensor, seen_mask: Tensor, reference: Tensor, reference_mask: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Means and log standard deviations (S, 3) of scaled offsets of sets.

        Args:
            seen: features of windows (S, W, F).
            seen_mask: (S, W), 1 for a window that is there.
            reference: features of windows seen from the prior pose (S, V, F).
            reference_mask: (S, V), all 0 where there is no reference.
        """
        pooled = torch.cat(
            [self._pool(seen, seen_mask), self._pool(reference, reference_mask)], dim=-1
        )
        out = self.together(pooled)
        return out[:, :3], out[:, 3:].clamp(_LEAST_LOG_SD, _MOST_LOG_SD)

    def _pool(self, features: Tensor, mask: Tensor) -> Tensor:
        """Mean, spread, chosen means and log count (S, P) of sets; zeros of an empty one."""
        raw = self.window((features - self.centre) / self.spread)
        values, logits = raw[..., :_POOLED], raw[..., _POOLED:]
        there = mask[..., None]
        count = there.sum(1)
        mean = (values * there).sum(1) / count.clamp(min=1)
        variance = (torch.square(values - mean[:, None]) * there).sum(1) / count.clamp(min=1)
        share = torch.softmax(logits.masked_fill(there == 0, -1e9), dim=1)  # (S, W, heads)
        chosen = (share.transpose(1, 2) @ (values * there)).flatten(1)
        size = torch.log1p(count).clamp(max=_MOST_LOG_COUNT)
        return torch.cat([mean, torch.sqrt(variance + 1e-6), chosen, size], dim=-1)
