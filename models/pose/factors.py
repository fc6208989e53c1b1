"""The interface of evidence that joins the tracks in the posterior over what moved."""

from typing import Protocol

from models.pose.hypotheses import PosePosterior


class Factor(Protocol):
    """Evidence beside the tracks, such as an image or a sensor of the camera.

    A factor is one file: it changes the weight of each hypothesis by its evidence for it, and where
    it measures the pose, the mean and covariance under each. `decide` sees hypotheses alone.
    """

    @property
    def name(self) -> str:
        """Short name of the evidence, such as `image`."""

    def updated(self, posterior: PosePosterior, moved_prior: float) -> PosePosterior:
        """The posterior with this evidence; `moved_prior` is the probability before any of it."""
