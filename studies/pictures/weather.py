"""What is done to a photograph: another turn, another light, people, rain, and a camera's JPEG."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.pictures.measures import Pixels

SIZE = (1280, 720)
_COVERED = 0.3  # of the picture by people, at most


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather:
    """How a picture is taken: gamma, blur (sd in px), noise (sd), JPEG's quality, and the rest.

    `shade` darkens one side as a cloud or a wall's shadow does; `covered` is the share that people
    and cars fill, `lorry` whether one thing of a third of the view has moved.
    """

    gamma: float = 1.0
    blur_px: float = 0.0
    noise: float = 2.0
    quality: int = 90
    rain: int = 0
    covered: float = 0.0
    shade: float = 0.0
    lorry: bool = False
    clock: bool = False
    seed: int = 0


def drawn(draw: np.random.Generator, *, lorries: bool = False) -> Weather:
    """Weather as it may come: some of all that is bad at once, or none of it."""
    often = draw.random(7)
    return Weather(
        gamma=math.exp(draw.uniform(-1, 1) * math.log(3)) if often[0] < 0.6 else 1.0,
        blur_px=float(draw.uniform(0, 2)) if often[1] < 0.4 else 0.0,
        noise=float(draw.uniform(1, 10)),
        quality=int(draw.integers(40, 95)),
        rain=int(draw.integers(100, 600)) if often[2] < 0.25 else 0,
        covered=float(draw.uniform(0, _COVERED)) if often[3] < 0.5 else 0.0,
        shade=float(draw.uniform(-0.7, 0.7)) if often[4] < 0.4 else 0.0,
        lorry=bool(lorries and often[5] < 0.15),
        clock=bool(often[6] < 0.5),
        seed=int(draw.integers(2**31)),
    )


def lens(focal_px: float = 980.0) -> Intrinsics:
    """The lens of all pictures here."""
    width, height = SIZE
    return Intrinsics(
        width=width,
        height=height,
        fx=focal_px,
        fy=focal_px,
        cx=(width - 1) / 2,
        cy=(height - 1) / 2,
    )


def fitted_to_view(grey: Pixels) -> Pixels:
    """The middle of a photograph as a picture of a camera, enlarged where it is small."""
    width, height = SIZE
    factor = max(width / grey.shape[1], height / grey.shape[0])
    kind = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    big = cv2.resize(grey, None, fx=factor, fy=factor, interpolation=kind)
    x, y = (big.shape[1] - width) // 2, (big.shape[0] - height) // 2
    return np.ascontiguousarray(big[y : y + height, x : x + width], np.uint8)


def turned(grey: Pixels, other: Pixels, rotation: Array, log_zoom: float = 0.0) -> Pixels:
    """What is seen after a turn, by K R K^-1; where nobody has looked yet, another photograph."""
    matrix = lens().matrix
    warp = matrix @ np.diag([*[math.exp(log_zoom)] * 2, 1.0]) @ rotation @ np.linalg.inv(matrix)
    seen = cv2.warpPerspective(grey, warp, SIZE, flags=cv2.INTER_CUBIC)
    inside = cv2.warpPerspective(np.full_like(grey, 255), warp, SIZE, flags=cv2.INTER_NEAREST)
    return np.where(inside > 0, seen, other).astype(np.uint8)


def taken(grey: Pixels, weather: Weather, others: Sequence[Pixels]) -> tuple[Pixels, Array]:
    """The picture that the camera sends in such weather, and the boxes (N, 4) of people."""
    draw = np.random.default_rng(weather.seed)
    picture = grey.copy()
    if weather.lorry:
        _paste(picture, _part(others, draw), _lorry(draw))
    boxes = _people(picture, weather.covered, others, draw)
    light = 255 * (picture.astype(np.float32) / 255) ** weather.gamma
    if weather.shade:
        where = 1 / (1 + np.exp(-(np.arange(SIZE[0]) - draw.uniform(0, SIZE[0])) / 40))
        light *= (1 - abs(weather.shade) * (where if weather.shade > 0 else 1 - where))[None]
    light = light.astype(np.float32)
    for _ in range(weather.rain):
        x, y, length = draw.integers((0, 0, 10), (*SIZE, 40)).tolist()
        cv2.line(light, (x, y), (x + length // 6, y + length), 210.0, 1, cv2.LINE_AA)
    if weather.blur_px:
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), weather.blur_px), np.float32)
    light += draw.normal(0, weather.noise, light.shape).astype(np.float32)
    sent = np.clip(light, 0, 255).astype(np.uint8)
    if weather.clock:
        _write(sent, weather.seed)
    quality = [cv2.IMWRITE_JPEG_QUALITY, weather.quality]
    packed = cv2.imencode(".jpg", sent, quality)[1]
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), np.uint8), boxes


def _people(
    picture: Pixels, covered: float, others: Sequence[Pixels], draw: np.random.Generator
) -> Array:
    """People and cars of other photographs, until so much is covered; their boxes."""
    boxes: list[tuple[int, int, int, int]] = []
    share = 0.0
    while share < covered:
        height = int(draw.integers(60, 300))
        width = int(height * draw.uniform(0.35, 1.5))
        x, y = (int(draw.integers(-20, side)) for side in SIZE)
        box = (max(x, 0), max(y, 0), min(x + width, SIZE[0]), min(y + height, SIZE[1]))
        _paste(picture, _part(others, draw), box)
        boxes.append(box)
        share += max(box[2] - box[0], 0) * max(box[3] - box[1], 0) / (SIZE[0] * SIZE[1])
    return np.array(boxes, np.float64).reshape(-1, 4)


def _part(others: Sequence[Pixels], draw: np.random.Generator) -> Pixels:
    other = others[int(draw.integers(len(others)))]
    return np.roll(other, draw.integers(0, 400, 2).tolist(), axis=(0, 1))


def _lorry(draw: np.random.Generator) -> tuple[int, int, int, int]:
    x, y = draw.integers((0, 60), (SIZE[0] - 640, 200)).tolist()
    return x, y, x + 640, y + 480  # a third of the view


def _paste(picture: Pixels, other: Pixels, box: tuple[int, int, int, int]) -> None:
    x1, y1, x2, y2 = box
    if x2 > x1 and y2 > y1:
        picture[y1:y2, x1:x2] = other[: y2 - y1, : x2 - x1]


def _write(picture: Pixels, seed: int) -> None:
    """A clock and a name, as cameras write them into their pictures."""
    clock = f"2026-11-{1 + seed % 28:02d} {seed % 24:02d}:{seed % 59:02d}:{seed % 60:02d}"
    for place, text in (((20, 44), clock), ((900, 700), "CAM 04 NORTH GATE")):
        for width, shade in ((5, 0), (2, 255)):
            cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 1.1, shade, width)
