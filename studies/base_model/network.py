"""The base model's network: walks before a camera and of its reference in, one offset out."""

from itertools import pairwise

import torch
from torch import Tensor, nn

from studies.base_model.features import FEATURES, SHORT, SHORTER, SLOPES, SLOPES_APART

_WIDTH = 96
_CODE = 64
_HEADS = 4
_SUMMARY = 128
_MOST_LOG_COUNT = 5.0
_LEAST_LOG_SD, _MOST_LOG_SD = -7.0, 1.0
_LEAST_LOG_WEIGHT, _MOST_LOG_WEIGHT = -8.0, 6.0
_RAW = 6  # the first columns: the equations, which the network must not read unbent
_AMISS = 0.3  # of a log pace: by how much the network puts what is usual right
_CORRECTED = 0.1  # of an offset, by one unit of what is left to correct
_FIGURES = 12  # that an equations' answer is summed up in
_UNITS = (0.1, 0.1, 0.2)  # of offsets, as the network reads them


class SetNetwork(nn.Module):
    """Weighted least squares whose weights and usual paces are learned, and a correction.

    Each segment has two equations, linear in the offset: how much its way is short of the usual
    pace, and its second half of its first. What is usual there, segments of the reference say that
    are alike (attention); or it is the same everywhere, for segments of the reference too, and the
    offset is what is between both answers. How far an equation is to be believed the network says,
    and which of the two ways of answering; what comes of it, it corrects.

    Source of the ideas: Zaheer et al. 2017, "Deep Sets", section 3 (sums over members make a
    function of a set); Kim et al. 2019, "Attentive Neural Processes", section 3.
    """

    centre: Tensor
    spread: Tensor
    units: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(FEATURES))
        self.register_buffer("spread", torch.ones(FEATURES))
        self.register_buffer("units", torch.tensor(_UNITS), persistent=False)
        self.segment = _perceptron(FEATURES, _WIDTH, _WIDTH, _CODE)
        self.asks = nn.Linear(_CODE, _CODE)
        self.tells = nn.Linear(_CODE, 2 * _CODE)
        self.nobody = nn.Parameter(torch.zeros(_CODE))  # the key where nobody is alike
        self.within = _perceptron(2 * _CODE + 2 * _HEADS, _WIDTH, _WIDTH, _WIDTH)
        self.equations = nn.Linear(_WIDTH, 4 + 2 * _HEADS)
        self.believed = nn.Parameter(torch.tensor([2.0, 2.0, 1.0]))  # log precision of no offset
        self.together = _perceptron(4 * _WIDTH + 3 * _FIGURES + 2, _SUMMARY, 64, 9)

    def forward(
        self, seen: Tensor, seen_mask: Tensor, reference: Tensor, reference_mask: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Offsets (S, 3), their log standard deviations, and those before correction (S, 3).

        Offsets are those of `offset_between`, from the pose that `seen` was looked at from.

        Args:
            seen: features of segments (S, W, F).
            seen_mask: (S, W), 1 for a segment that is there.
            reference: features of segments looked at from the prior pose (S, V, F).
            reference_mask: (S, V), all 0 where there is no reference.
        """
        code, known = self._code(seen), self._code(reference)
        context, paces = self._attend(code, known, reference, reference_mask)
        beside, figures = self._solve(seen, seen_mask, code, context, paces)
        here, here_figures = self._solve(seen, seen_mask, code, 0 * context, 0 * paces)
        nothing = known.new_zeros(*known.shape[:2], _HEADS, 2)
        there, there_figures = self._solve(reference, reference_mask, known, 0 * known, nothing)
        out = self.together(
            torch.cat(
                [
                    figures,
                    here_figures[:, -_FIGURES:],
                    there_figures,
                    _log_count(seen_mask),
                    _log_count(reference_mask),
                ],
                dim=-1,
            )
        )
        share = torch.sigmoid(out[:, 6:]) * (reference_mask.sum(1, keepdim=True) > 0)
        solved = (1 - share) * beside + share * (here - there)
        mean = solved + _CORRECTED * out[:, :3]
        return mean, out[:, 3:6].clamp(_LEAST_LOG_SD, _MOST_LOG_SD), solved

    def _code(self, features: Tensor) -> Tensor:
        """Codes (S, W, C) of segments."""
        code: Tensor = self.segment((bent(features) - self.centre) / self.spread)
        return code

    def _attend(
        self, code: Tensor, known: Tensor, reference: Tensor, mask: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Attend from segments (S, W, C) to those of the reference like them, and to their paces.

        Paces (S, W, heads, 2) are usual log paces and their change; 0 where nobody is like them.
        """
        sets, segments, others = len(code), code.shape[1], known.shape[1]
        apart = _CODE // _HEADS
        query = self.asks(code).view(sets, segments, _HEADS, apart)
        keys, values = self.tells(known).view(sets, others, 2, _HEADS, apart).unbind(2)
        alike = torch.einsum("swhc,svhc->shwv", query, keys) / apart**0.5
        alike = alike.masked_fill(mask[:, None, None] == 0, -1e9)
        nobody = (query * self.nobody.view(_HEADS, apart)).sum(-1).transpose(1, 2)[..., None]
        share = torch.softmax(torch.cat([alike, nobody], dim=-1), dim=-1)[..., :-1]
        context = torch.einsum("shwv,svhc->swhc", share, values).flatten(-2)
        paces = -torch.stack([reference[..., SHORT], reference[..., SHORTER]], dim=-1)
        return context, torch.einsum("shwv,svr->swhr", share, paces)

    def _solve(
        self, features: Tensor, mask: Tensor, code: Tensor, context: Tensor, paces: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The offset (S, 3) of the equations, and what sums them up (S, 2 C + 12)."""
        read = nn.functional.silu(
            self.within(torch.cat([code, context, paces.flatten(-2)], dim=-1))
        )
        terms = self.equations(read)
        shares = torch.softmax(terms[..., 4:].unflatten(-1, (2, _HEADS)), dim=-1)
        usual = (shares * paces.transpose(-1, -2)).sum(-1) + _AMISS * terms[..., 2:4]
        weight = torch.exp(terms[..., :2].clamp(_LEAST_LOG_WEIGHT, _MOST_LOG_WEIGHT))
        weight = weight * mask[..., None]
        ones = torch.ones_like(features[..., :1])
        rows = torch.stack(
            [
                torch.cat([features[..., SLOPES], ones], dim=-1),
                torch.cat([features[..., SLOPES_APART], 0 * ones], dim=-1),
            ],
            dim=-2,
        )  # (S, W, 2, 3)
        short = torch.stack([features[..., SHORT], features[..., SHORTER]], dim=-1) + usual
        weighted = rows * weight[..., None]
        precision = torch.einsum("swri,swrj->sij", weighted, rows)
        precision = precision + torch.diag_embed(torch.exp(self.believed))
        variance = torch.linalg.inv(precision)
        pull = torch.einsum("swri,swr->si", weighted, short)
        solved = torch.einsum("sij,sj->si", variance, pull)
        left = short - torch.einsum("swri,si->swr", rows, solved)
        total = weight.sum(1) + 1e-6
        sd = torch.sqrt(torch.diagonal(variance, dim1=1, dim2=2))
        alike = variance / (sd[:, None] * sd[:, :, None])
        figures = [
            *_mean_and_spread(read, mask),
            solved / self.units,
            torch.log(sd / self.units),
            alike[:, (0, 0, 1), (1, 2, 2)],
            torch.log((torch.square(left) * weight).sum(1) / total + 1e-6),
            torch.log(total[:, :1]),
        ]
        return solved, torch.cat(figures, dim=-1)


def bent(features: Tensor) -> Tensor:
    """Features (..., F) as the network reads them: slopes of far walkers are bent into reach."""
    return torch.cat([torch.asinh(features[..., :_RAW]), features[..., _RAW:]], dim=-1)


def _perceptron(*widths: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.SiLU()]
    return nn.Sequential(*layers[:-1])


def _mean_and_spread(values: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Means and standard deviations (S, C) of sets (S, W, C); zeros of an empty one."""
    there = mask[..., None]
    count = there.sum(1).clamp(min=1)
    mean = (values * there).sum(1) / count
    variance = (torch.square(values - mean[:, None]) * there).sum(1) / count
    return mean, torch.sqrt(variance + 1e-6)


def _log_count(mask: Tensor) -> Tensor:
    return torch.log1p(mask.sum(1, keepdim=True)).clamp(max=_MOST_LOG_COUNT)
