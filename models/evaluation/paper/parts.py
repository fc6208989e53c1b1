"""All parts of the study of the paper, by name, in the order in which they are told."""

from models.evaluation.paper.dsac import DSAC
from models.evaluation.paper.part import PaperPart
from models.evaluation.paper.peers import PEERS
from models.evaluation.paper.posenet import POSENET
from models.evaluation.paper.regressors_table import REGRESSORS
from models.evaluation.paper.stairs import STAIRS
from models.evaluation.paper.sweep import SPEED_SWEEP
from models.evaluation.paper.vanishing import VANISHING_POINTS

PARTS: dict[str, PaperPart] = {
    "regressors": REGRESSORS,
    "posenet": POSENET,
    "dsac": DSAC,
    "vanishing-points": VANISHING_POINTS,
    "peers": PEERS,
    "stairs": STAIRS,
    "speed-sweep": SPEED_SWEEP,
}
