"""The tasks as environments: PettingZoo (turns, joint moves), Gymnasium (one or many), dm_env.

Importing the package registers the ids of `registration.IDS`; what they make is loaded when made:

    import gymnasium
    import hose_mj.envs

    env = gymnasium.make("hose_mj/Line-v0", n_robots=4)
"""

from hose_mj.envs.registration import register_all

register_all()
