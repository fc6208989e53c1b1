import pytest
import torch

from studies.base_model.features import FEATURES, SHORT, SHORTER, SLOPES, SLOPES_APART
from studies.base_model.network import SetNetwork


@pytest.fixture
def network() -> SetNetwork:
    torch.manual_seed(0)
    return SetNetwork().eval()


def test_neither_order_nor_padding_matter(network: SetNetwork):
    seen, reference = torch.randn(2, 9, FEATURES), torch.randn(2, 5, FEATURES)
    ones = torch.ones(2, 9), torch.ones(2, 5)
    answer = network(seen, ones[0], reference, ones[1])
    order = torch.randperm(9)
    again = network(seen[:, order], ones[0], reference[:, [4, 2, 0, 1, 3]], ones[1])
    torch.testing.assert_close(again, answer, rtol=1e-4, atol=1e-5)
    padded = torch.cat([seen, 3 * torch.randn(2, 3, FEATURES)], dim=1)
    mask = torch.cat([ones[0], torch.zeros(2, 3)], dim=1)
    torch.testing.assert_close(
        network(padded, mask, reference, ones[1]), answer, rtol=1e-4, atol=1e-5
    )


def test_no_reference_is_one_case_whatever_its_padding(network: SetNetwork):
    seen, ones = torch.randn(1, 9, FEATURES), torch.ones(1, 9)
    empty = network(seen, ones, torch.zeros(1, 0, FEATURES), torch.zeros(1, 0))
    padded = network(seen, ones, torch.randn(1, 4, FEATURES), torch.zeros(1, 4))
    torch.testing.assert_close(padded, empty)


def test_untrained_its_equations_are_least_squares(network: SetNetwork):
    """All segments believed alike and at the assumed pace: the offset that made them short."""
    for layer in (network.equations, network.together[-1]):
        torch.nn.init.zeros_(layer.weight)
        torch.nn.init.zeros_(layer.bias)
    seen, truth = torch.randn(1, 200, FEATURES), torch.tensor([0.1, -0.05, 0.2])
    seen[..., SHORT] = seen[..., SLOPES] @ truth[:2] + truth[2]
    seen[..., SHORTER] = seen[..., SLOPES_APART] @ truth[:2]
    nobody = torch.zeros(1, 0, FEATURES), torch.zeros(1, 0)
    mean, _, solved = network(seen, torch.ones(1, 200), *nobody)
    # That no offset is likelier than another takes a few hundredths off.
    torch.testing.assert_close(solved[0], truth, rtol=0.05, atol=2e-3)
    torch.testing.assert_close(mean, solved)
