"""The tasks as environments: PettingZoo (turns, joint moves), Gymnasium (one or many), dm_env.

Importing the package registers an id for each task; what it makes is loaded when it is made:

    import gymnasium
    import hose_mj.envs

    env = gymnasium.make("hose_mj/Line-v0", n_robots=4)

`import hose_mj` does the same where Gymnasium has been imported before it. A task of another
package, `rope-pull` say, is `hose_mj/RopePull-v0`.
"""

import re
import warnings

from hose_mj.errors import InputError
from hose_mj.extras import require
from hose_mj.tasks.registry import TASKS, find_task_plugins

require("rl", "hose_mj.envs")


def name_environment(task: str) -> str:
    """Returns the id of a task's environment: that of line-2015 is hose_mj/Line2015-v0."""
    words = re.split("[-_]", task)
    return f"hose_mj/{''.join(word[:1].upper() + word[1:] for word in words)}-v0"


IDS = {name_environment(task): task for task in TASKS}  # our tasks' ids by environment id
ALONE = {name_environment(task) for task, entry in TASKS.items() if entry.is_alone}
"""Those of one agent, which PettingZoo does not get."""


def register_all() -> None:
    """Registers every id that is not registered yet, those of other packages' tasks too."""
    import gymnasium
    import pettingzoo

    ids = dict(IDS)
    try:
        ids |= {name_environment(task): task for task in find_task_plugins()}
    except InputError as error:
        warnings.warn(f"tasks of other packages have no environments: {error}", stacklevel=2)
    for id, task in ids.items():
        if id not in gymnasium.registry:
            gymnasium.register(
                id,
                entry_point="hose_mj.envs.gym:TaskEnv",
                vector_entry_point="hose_mj.envs.vector:VectorTaskEnv",
                kwargs={"task": task},
            )
        if id in ALONE:
            continue
        if id not in pettingzoo.aec_registry:
            entry_point = "hose_mj.envs.turns:TurnsEnv"
            pettingzoo.register("aec", id, entry_point=entry_point, kwargs={"task": task})
        if id not in pettingzoo.parallel_registry:
            entry_point = "hose_mj.envs.parallel:JointEnv"
            pettingzoo.register("parallel", id, entry_point=entry_point, kwargs={"task": task})


register_all()
