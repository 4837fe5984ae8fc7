"""What the package adds; the entries name the modules, which are imported when they are made."""

from hose_learning.learners.catalog import LearnerEntry

from hose_mj.tasks.registry import TaskEntry

ROPE_PULL = TaskEntry(
    "rope_pull.task", "RopeSettings", "make_rope_pull", "two robots pull a rope to a mark"
)
PATIENT_Q = LearnerEntry(
    module="rope_pull.patient_q",
    schedule="joint",
    section="another package's",
    description="Q-learning of agents that move at once, rewards in full and losses by half",
    values="monolithic",
)
