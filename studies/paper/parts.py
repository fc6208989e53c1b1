"""All parts of the study of the paper, by name, in the order in which they are told."""

from studies.paper.dsac import DSAC
from studies.paper.part import PaperPart
from studies.paper.peers import PEERS
from studies.paper.posenet import POSENET
from studies.paper.regressors_table import REGRESSORS
from studies.paper.stairs import STAIRS
from studies.paper.sweep import SPEED_SWEEP
from studies.paper.vanishing import VANISHING_POINTS

PARTS: dict[str, PaperPart] = {
    "regressors": REGRESSORS,
    "posenet": POSENET,
    "dsac": DSAC,
    "vanishing-points": VANISHING_POINTS,
    "peers": PEERS,
    "stairs": STAIRS,
    "speed-sweep": SPEED_SWEEP,
}
