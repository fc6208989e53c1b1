"""Seeded and small: the same examples on every run, one thread of torch."""

import hypothesis
import torch

torch.set_num_threads(1)
hypothesis.settings.register_profile("seeded", derandomize=True, deadline=None, max_examples=60)
hypothesis.settings.load_profile("seeded")
