"""The affine map from the numbers of another image to the pixels of a camera's frame."""

from dataclasses import dataclass, replace

from models.geometry.rotation import Array
from models.tracks.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """Frame pixels are `factor * number + shift`, for u and for v.

    Pixels of both images count from the centre of the first pixel. Shares of an image
    (`normalised`) count from its edge.
    """

    factor: tuple[float, float]
    shift: tuple[float, float]
    normalised: bool = False

    def applied(self, numbers: Array) -> Array:
        """Frame pixels (N, 2 k) of numbers (N, 2 k): columns are u, v, u, v."""
        pairs = numbers.reshape(len(numbers), -1, 2)
        return (pairs * self.factor + self.shift).reshape(numbers.shape)

    def inverted(self, pixels: Array) -> Array:
        """The numbers (N, 2 k) that `applied` maps to pixels (N, 2 k)."""
        pairs = pixels.reshape(len(pixels), -1, 2)
        return ((pairs - self.shift) / self.factor).reshape(pixels.shape)

    def of_trajectory(self, trajectory: Trajectory) -> Trajectory:
        """The trajectory in frame pixels."""
        top_v, heads = trajectory.top_v, trajectory.head_uv
        return replace(
            trajectory,
            uv=self.applied(trajectory.uv),
            top_v=None if top_v is None else top_v * self.factor[1] + self.shift[1],
            head_uv=None if heads is None else self.applied(heads),
        )


SAME = Scaling(factor=(1.0, 1.0), shift=(0.0, 0.0))


def scaling_of_shares(frame: tuple[int, int]) -> Scaling:
    """The map of shares of an image, 0 to 1, to the pixels of a frame (width, height)."""
    factor = (float(frame[0]), float(frame[1]))
    return Scaling(factor=factor, shift=(-0.5, -0.5), normalised=True)


def scaling_of_size(size: tuple[float, float], frame: tuple[int, int]) -> Scaling:
    """The map of pixels of an image of a size to those of a frame, both (width, height)."""
    u, v = frame[0] / size[0], frame[1] / size[1]
    return Scaling(factor=(u, v), shift=((u - 1) / 2, (v - 1) / 2))
