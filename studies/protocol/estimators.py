"""The estimators of the protocol that need no training, by the names of its tables."""

from studies.protocol.base_runs import base_model
from studies.protocol.flow_runs import fused, registration
from studies.protocol.joint_runs import joint, joint_assumed, joint_feet
from studies.protocol.learned import LearnedEstimator

UNTRAINED: dict[str, LearnedEstimator] = {
    "base model": base_model,
    "joint": joint,
    "joint, feet only": joint_feet,
    "joint, no reference": joint_assumed,
    "registration": registration,
    "fused": fused,
}
