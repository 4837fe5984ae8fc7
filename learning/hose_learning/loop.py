"""One loop for each schedule: agents that move in turns (or a single one), and jointly.

Beside them stand what logs moves at random, and the vetoes of a loop by themselves.

Compiled for compiled tasks; the same source, `run_turns.py_func` and `run_joint.py_func`, runs any
other. Both stop after a number of moves or episodes, when the log is full, or when a table is about
to be; calling them again goes on exactly where they stopped.
"""

from typing import Any, NamedTuple

from hose_learning import records, rules
from hose_learning.mediators import compute_above_thresholds
from hose_learning.policies import GREEDY, compute_best, draw_allowed, draw_soft_max
from hose_learning.records import EPISODES, EPSILON, FRESH, RETURN, Learner, Log, Memory
from hose_learning.tables import claim, count_free, find
from hose_mj.jit import bitwise, compiled, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import STEPS, TURN, Floats, Integers
from hose_mj.tasks.stream import Stream, draw_unit


@jitable
def has_room(learner: Learner, memory: Memory, log: Log, n_moves: int) -> bool:
    """Whether tables and log have room for that many more moves."""
    free = min(
        count_free(memory.table) // max(1, learner.bases.shape[0]),
        count_free(memory.vetoes) // max(1, learner.veto_bases.shape[0]),
    )
    # A move completes at most one update for each agent.
    return free > (n_moves + 1) * memory.actions.shape[0] and log.used[0] < log.returns.shape[0]


@jitable
def see(task: Any, learner: Learner, memory: Memory, agent: int) -> int:
    """Lets an agent's modules look at the state; returns what it may do, as bits."""
    values = memory.values
    kernels.observe(task, memory.state, agent, values)
    for module in range(learner.bases.shape[0]):
        # A team has one part for all its agents.
        key = learner.bases[module, min(agent, learner.bases.shape[1] - 1)]
        for k in range(learner.columns.shape[1]):
            key += values[learner.columns[module, k]] * learner.strides[module, k]
        memory.keys[agent, module] = key
    allowed = kernels.mask(task, memory.state, agent)
    for module in range(learner.veto_bases.shape[0]):
        key = learner.veto_bases[module, agent]
        for k in range(learner.veto_columns.shape[1]):
            key += values[learner.veto_columns[module, k]] * learner.veto_strides[module, k]
        memory.veto_keys[agent, module] = key
        allowed &= ~memory.vetoes.rows[find(memory.vetoes, key), 0]
    return allowed


@jitable
def keep_keys(learner: Learner, memory: Memory, agent: int) -> None:
    """Keeps what the agent's modules see as what they saw at its last move."""
    for module in range(learner.bases.shape[0]):
        memory.last_keys[agent, module] = memory.keys[agent, module]
    for module in range(learner.veto_bases.shape[0]):
        memory.last_veto_keys[agent, module] = memory.veto_keys[agent, module]


@jitable
def choose(
    task: Any, learner: Learner, memory: Memory, agent: int, allowed: int, explores: bool
) -> int:
    """Chooses the agent's action among the allowed, epsilon-greedily (eqs 4.4, 5.2) or soft max."""
    if learner.has_thresholds:
        allowed &= compute_above_thresholds(learner, memory, agent, memory.scores.shape[0])
    allowed = rules.mask(learner.rule, memory, agent, allowed)
    if allowed == 0:
        if learner.fallback >= 0:
            return learner.fallback
        allowed = kernels.mask(task, memory.state, agent)
    if explores and learner.policy == GREEDY and draw_unit(memory.stream) < memory.numbers[EPSILON]:
        return draw_allowed(allowed, memory.stream)
    rules.score(learner.rule, learner, memory, agent)
    if explores and learner.policy != GREEDY and memory.numbers[records.TEMPERATURE] > 0.0:
        temperature = memory.numbers[records.TEMPERATURE]
        return draw_soft_max(memory.scores, allowed, temperature, memory.stream)
    return draw_allowed(compute_best(memory.scores, allowed), memory.stream)


@jitable
def veto(learner: Learner, memory: Memory, agent: int, events: int) -> None:
    """Vetoes the agent's last action where the events concern its modules (section 5.3)."""
    for module in range(learner.veto_bases.shape[0]):
        concerned = learner.veto_actions[module] >> memory.actions[agent] & 1
        if concerned and events & learner.veto_events[module]:
            row = claim(memory.vetoes, memory.last_veto_keys[agent, module])
            memory.vetoes.rows[row, 0] |= 1 << memory.actions[agent]


@jitable
def begin_episode(task: Any, memory: Memory) -> None:
    """Resets the task; nobody has moved yet."""
    kernels.reset(task, memory.state, memory.starts)
    memory.steps_since_action[:] = -1
    memory.numbers[RETURN] = 0.0
    memory.counters[FRESH] = 0


@jitable
def log_episode(task: Any, learner: Learner, memory: Memory, log: Log, events: int) -> None:
    """Logs an episode that ended with these events, and lets epsilon fall."""
    success = events & task.success != 0
    row = log.used[0]
    log.episodes[row, 0] = memory.state[STEPS]
    log.episodes[row, 1] = events
    log.returns[row] = memory.numbers[RETURN]
    log.used[0] = row + 1
    memory.counters[EPISODES] += 1
    memory.counters[records.SUCCESSES] += success
    fall = learner.per_episode + learner.per_success * success
    memory.numbers[EPSILON] = max(learner.least_epsilon, memory.numbers[EPSILON] - fall)
    memory.numbers[records.TEMPERATURE] = learner.temperature_factor * memory.numbers[EPSILON]
    memory.counters[FRESH] = 1


@jitable
def count_events(task: Any, learner: Learner, memory: Memory, events: int) -> None:
    """Counts the events of one mover and what they are worth."""
    memory.numbers[RETURN] += learner.return_of_event[events]
    for event in range(memory.event_counts.shape[0]):
        memory.event_counts[event] += events >> event & 1


@bitwise
def run_turns(
    task: Any, learner: Learner, memory: Memory, log: Log, max_moves: int, max_episodes: int
) -> int:
    """Trains agents that move one after the other; returns the number of moves.

    The memory is changed in place, and the log gets a row for each episode that ends. It ends after
    that many moves of single agents or episodes, or where there is no more room.
    """
    last_episode = memory.counters[EPISODES] + max_episodes
    moves = 0
    while moves < max_moves and has_room(learner, memory, log, 1):
        if memory.counters[EPISODES] >= last_episode:
            break
        if memory.counters[FRESH]:
            begin_episode(task, memory)
        agent = memory.state[TURN]
        allowed = see(task, learner, memory, agent)
        rules.on_observe(learner.rule, learner, memory, agent)
        action = choose(task, learner, memory, agent, allowed, True)
        events = kernels.apply(task, memory.state, agent, action)
        moves += 1
        memory.counters[records.MOVES] += 1
        memory.actions[agent] = action
        memory.steps_since_action[agent] = 0
        keep_keys(learner, memory, agent)
        if events:
            count_events(task, learner, memory, events)
            if learner.shares_vetoes:
                for other in range(memory.actions.shape[0]):
                    if memory.steps_since_action[other] >= 0:
                        veto(learner, memory, other, events)
            else:
                veto(learner, memory, agent, events)
        rules.accumulate(learner.rule, learner, memory, agent, action, events)
        is_over = kernels.is_over(task, events)
        if is_over or kernels.is_cut_off(task, memory.state):
            if not is_over:  # one agent's cycle is complete all the same
                agent = memory.state[TURN]
                see(task, learner, memory, agent)
                rules.on_observe(learner.rule, learner, memory, agent)
                memory.steps_since_action[agent] = -1
            rules.end_episode(learner.rule, learner, memory, is_over)
            log_episode(task, learner, memory, log, events)
    return moves


@jitable
def accumulate_joint(learner: Learner, memory: Memory) -> None:
    """Writes what each agent's modules are rewarded with for a joint move."""
    memory.rewards[:] = 0.0
    n_agents = memory.actions.shape[0]
    for agent in range(n_agents):
        for mover in range(n_agents):
            for module in range(learner.bases.shape[0]):
                reward = learner.rewards[memory.caused_events[mover], int(mover == agent), module]
                memory.rewards[agent, module] += reward


@bitwise
def run_joint(
    task: Any, learner: Learner, memory: Memory, log: Log, max_moves: int, max_episodes: int
) -> int:
    """Trains agents that move at once; arguments and result are those of `run_turns`.

    A joint move counts as many moves as there are agents.
    """
    n_agents = memory.actions.shape[0]
    last_episode = memory.counters[EPISODES] + max_episodes
    moves = 0
    while moves < max_moves and has_room(learner, memory, log, n_agents):
        if memory.counters[EPISODES] >= last_episode:
            break
        if memory.counters[FRESH]:
            begin_episode(task, memory)
            for agent in range(n_agents):
                memory.allowed[agent] = see(task, learner, memory, agent)
        rules.choose_joint(learner.rule, task, learner, memory, True)
        for agent in range(n_agents):
            keep_keys(learner, memory, agent)
        events = kernels.apply_joint(task, memory.state, memory.actions, memory.caused_events)
        moves += n_agents
        memory.counters[records.MOVES] += n_agents
        accumulate_joint(learner, memory)
        for agent in range(n_agents):
            if memory.caused_events[agent]:
                count_events(task, learner, memory, memory.caused_events[agent])
                veto(learner, memory, agent, memory.caused_events[agent])
        is_over = kernels.is_over(task, events)
        if not is_over:
            for agent in range(n_agents):
                memory.allowed[agent] = see(task, learner, memory, agent)
        rules.learn_joint(learner.rule, learner, memory, is_over)
        if is_over or kernels.is_cut_off(task, memory.state):
            log_episode(task, learner, memory, log, events)
    return moves


class Rows(NamedTuple):
    """One row for each move of an agent."""

    values: Integers  # all variables as the mover saw them before the move (n, n_variables)
    agents: Integers  # who moved (n,)
    actions: Integers  # its action (n,)
    events: Integers  # what the move caused, as bits (n,)
    rewards: Floats  # what the mover got for it, by signal (n, n_signals)
    # What the mover saw right after its move, before anyone else's (n, n_variables).
    next_values: Integers


@compiled
def fill_rows(record: Any, state: Integers, stream: Stream, rows: Rows) -> None:
    """Plays random available actions, agents in turn, until all rows are written in place.

    The state, an initial one, is advanced through as many episodes as it takes; the stream decides
    actions and resets.
    """
    for k in range(rows.agents.shape[0]):
        agent = state[TURN]
        kernels.observe(record, state, agent, rows.values[k])
        action = draw_allowed(kernels.mask(record, state, agent), stream)
        events = kernels.apply(record, state, agent, action)
        rows.agents[k] = agent
        rows.actions[k] = action
        rows.events[k] = events
        kernels.compute_rewards(record, events, agent, agent, rows.rewards[k])
        kernels.observe(record, state, agent, rows.next_values[k])
        if kernels.is_over(record, events) or kernels.is_cut_off(record, state):
            kernels.reset(record, state, stream)


@bitwise
def compute_unvetoed(task: Any, learner: Learner, memory: Memory, agent: int) -> int:
    """Returns, as bits, what nothing forbids the agent in `memory.state`; maybe nothing."""
    allowed = see(task, learner, memory, agent)
    if learner.has_thresholds:
        allowed &= compute_above_thresholds(learner, memory, agent, memory.scores.shape[0])
    return allowed


@bitwise
def add_vetoes(
    task: Any, learner: Learner, memory: Memory, agent: int, action: int, events: int
) -> None:
    """Vetoes an action that the agent took in `memory.state`, where its events are a reason to."""
    see(task, learner, memory, agent)
    keep_keys(learner, memory, agent)
    memory.actions[agent] = action
    veto(learner, memory, agent, events)
