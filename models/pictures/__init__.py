"""A camera's turn by two of its pictures, and what else a picture tells.

What the rest of the house asks of it stands here.
"""

from models.pictures.features import Features, describe_jpeg, read_gallery
from models.pictures.gallery import best_turn, bridged, renewed
from models.pictures.health import PictureFault, judge
from models.pictures.turn import Turn, aim_of, turned_covariance, turned_pose

__all__ = [
    "Features",
    "PictureFault",
    "Turn",
    "aim_of",
    "best_turn",
    "bridged",
    "describe_jpeg",
    "judge",
    "read_gallery",
    "renewed",
    "turned_covariance",
    "turned_pose",
]
