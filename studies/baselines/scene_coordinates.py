"""DSAC++: a network that says of every patch of a picture which place in the world it shows.

The baseline of Xu et al. 2020, table 2, after Brachmann and Rother 2018, on pictures of single
walks, white on black, and as small as is honest: places are learned directly first (of simulated
pictures every one is known, which is more than DSAC++ has), then the pose end to end. A patch of
nothing looks the same wherever the camera looks, so the network can only say where on the ground
such patches are on average; and places that are all the same are no pose.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, pose_from_matrices
from models.geometry.rotation import Array, Mask
from models.regression.recipe import TrainingPlan
from models.simulation.poses import PoseSet, random_poses
from models.simulation.walkers import simulate_walks
from studies.baselines.differentiable_ransac import (
    best_pose,
    expected_loss,
    rotation_of,
    rotation_of_turn,
)
from studies.baselines.posenet import Images, draw_walks

_STRIDE = 8
_CHANNELS = (32, 64, 128)
_LEARNING_RATE, _END_TO_END_RATE = 1e-3, 1e-5
_BATCH = 16
_HYPOTHESES = 8
_FARTHEST_M = 60.0
_UNIT_M = 10.0  # what a network says is of about 1


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchSet:
    """Pictures (B, H, W), the places (B, N, 3) in metres of their patches, and which are ground.

    Places are against the point of the ground below the camera; `poses` are what they were seen
    from.
    """

    images: Tensor
    places_m: Tensor
    on_ground: Tensor
    poses: PoseSet


class SceneCoordinateNet(nn.Module):
    """Places (B, N, 3) in metres of patches of 8 x 8 pixels of pictures (B, H, W) of 0 to 255.

    The mean place (3,) of all patches is where it begins.
    """

    def __init__(self, mean_m: Array) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, outputs in zip((1, *_CHANNELS), _CHANNELS, strict=False):
            layers += [nn.Conv2d(inputs, outputs, 3, stride=2, padding=1), nn.ReLU()]
        wide = _CHANNELS[-1]
        layers += [nn.Conv2d(wide, wide, 3, padding=1), nn.ReLU(), nn.Conv2d(wide, 3, 1)]
        self.layers = nn.Sequential(*layers)
        self.register_buffer("mean", torch.tensor(mean_m, dtype=torch.float32))

    def forward(self, images: Tensor) -> Tensor:
        """Row by row of the picture's patches."""
        raw: Tensor = self.layers(images[:, None].float() / 255)
        return raw.flatten(2).transpose(1, 2) * _UNIT_M + self.get_buffer("mean")


def patch_pixels(intrinsics: Intrinsics, images: Images | Tensor) -> Array:
    """The pixels (N, 2), in the lens's, of the middles of the patches of pictures (B, H, W)."""
    rows, columns = (-(-size // _STRIDE) for size in images.shape[1:])
    u, v = np.meshgrid(np.arange(columns), np.arange(rows))
    # A convolution of stride 2 and padding 1 has its middle on every second pixel, from 0 on.
    small = _STRIDE * np.stack([u.ravel(), v.ravel()], axis=-1).astype(np.float64)
    scale = images.shape[2] / intrinsics.width
    return np.asarray((small + 0.5) / scale - 0.5)


def patch_set(plan: TrainingPlan, count: int, rng: np.random.Generator) -> PatchSet:
    """Pictures of walks seen from poses drawn over a plan's range.

    Raises:
        DegenerateGeometryError: the camera sees no ground to walk on.
    """
    poses = random_poses(plan.prior_pose, plan.recipe.spread, count, rng)
    walks = simulate_walks(plan.intrinsics, poses, plan.walk, rng)
    images = draw_walks(walks.uv, plan.intrinsics)
    return patches_of(plan.intrinsics, images, poses.take(walks.pose_idx))


def patches_of(intrinsics: Intrinsics, images: Images, poses: PoseSet) -> PatchSet:
    """Pictures with the places of their patches."""
    uv = patch_pixels(intrinsics, images)
    centre = poses.centre_m
    pixels = np.broadcast_to(uv, (len(images), *uv.shape))
    ground, valid = ground_from_pixel(intrinsics, poses.rotation, centre, pixels)
    places = np.concatenate([ground - centre[:, None, :2], np.zeros((*valid.shape, 1))], axis=-1)
    near: Mask = valid & (np.linalg.norm(np.nan_to_num(places), axis=-1) < _FARTHEST_M)
    return PatchSet(
        images=torch.from_numpy(images),
        places_m=torch.from_numpy(np.where(near[..., None], places, 0.0).astype(np.float32)),
        on_ground=torch.from_numpy(near),
        poses=poses,
    )


def train_places(
    data: PatchSet, *, epochs: int, seed: int, on_share: Callable[[float], None] = lambda _: None
) -> SceneCoordinateNet:
    """The first stage: places of ground patches, by their distance in the mean."""
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    network = SceneCoordinateNet(data.places_m[data.on_ground].mean(dim=0).double().numpy())
    optimizer = torch.optim.Adam(network.parameters(), lr=_LEARNING_RATE)
    batches = max(1, len(data.images) // _BATCH)
    for epoch in range(epochs):
        for number, rows in enumerate(np.array_split(rng.permutation(len(data.images)), batches)):
            optimizer.zero_grad()
            torch.autograd.backward(_places_off(network, data, rows))
            optimizer.step()
            on_share((epoch + (number + 1) / batches) / epochs)
    return network


def train_end_to_end(
    network: SceneCoordinateNet,
    data: PatchSet,
    intrinsics: Intrinsics,
    *,
    alpha: float,
    seed: int,
    on_share: Callable[[float], None] = lambda _: None,
) -> None:
    """The second stage: the expected pose's loss, one picture after the other."""
    rng = np.random.default_rng(seed)
    optimizer = torch.optim.Adam(network.parameters(), lr=_END_TO_END_RATE)
    rays, _ = intrinsics.rays(patch_pixels(intrinsics, data.images))
    for number in range(len(data.images)):
        seen = data.on_ground[number].numpy()
        true = torch.from_numpy(data.poses.rotation[number])
        height_m = float(data.poses.height_m[number])

        def off(pose: Tensor, true: Tensor = true, height_m: float = height_m) -> Tensor:
            rotation = rotation_of(pose[:3])
            centre_z = -(rotation.T @ pose[3:])[2]
            # |q - q'| of unit quaternions is this of their matrices, where the angle is small.
            turned = torch.linalg.matrix_norm(rotation - true.to(pose.dtype)) / 8**0.5
            both: Tensor = (centre_z - height_m).abs() + alpha * turned
            return both

        places = network(data.images[number : number + 1])[0][seen]
        loss = expected_loss(places, rays[seen, :2], off, _HYPOTHESES, rng)
        on_share((number + 1) / len(data.images))
        if loss is None or not torch.isfinite(loss):
            continue
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()


def pose_seen(
    network: SceneCoordinateNet,
    image: Images,
    intrinsics: Intrinsics,
    below: Sequence[float],
    rng: np.random.Generator,
    hypotheses: int = 64,
) -> CameraPose:
    """The pose that a picture (H, W) shows; `below` is the point of the ground below the camera.

    Raises:
        TooFewTrajectoriesError: its patches make no pose.
        ShapeError: the pose is below the ground.
    """
    rays, _ = intrinsics.rays(patch_pixels(intrinsics, image[None]))
    with torch.inference_mode():
        places = network(torch.from_numpy(image[None]))[0].double().numpy()
    pose = best_pose(places + np.array([*below, 0.0]), rays[:, :2], hypotheses, rng)
    return pose_from_matrices(rotation_of_turn(pose[:3]), pose[3:])


def _places_off(network: SceneCoordinateNet, data: PatchSet, rows: npt.NDArray[np.int64]) -> Tensor:
    """Errors of places, in metres, over the ground patches of some pictures."""
    off = torch.linalg.vector_norm(network(data.images[rows]) - data.places_m[rows], dim=-1)
    mean: Tensor = off[data.on_ground[rows]].mean()
    return mean


def mean_places_off(network: SceneCoordinateNet, data: PatchSet) -> float:
    """Mean error of places, in metres, over all ground patches."""
    with torch.inference_mode():
        return float(_places_off(network, data, np.arange(len(data.images))))
