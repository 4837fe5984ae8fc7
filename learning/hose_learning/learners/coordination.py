"""What learners on a coordination graph share (section 3.6.3, Figure 3.3).

Each edge {i, j} has values Q_ij(s, a_i, a_j) of its own for each module; their sum over the edges
stands for the team's Q(s, a). An edge sees what the first of its two agents sees.
"""

from typing import Any

from hose_learning.learners import solvers
from hose_learning.learners.joint import allow_fallbacks, draw_each
from hose_learning.learners.solvers import Graph
from hose_learning.mediators import GREATEST_MASS, MEDIATORS
from hose_learning.records import EPSILON, Learner, Memory
from hose_learning.settings import LearnerSettings, check_range
from hose_learning.tables import claim, find
from hose_mj.errors import InputError
from hose_mj.jit import jitable
from hose_mj.tasks.checks import check_choice
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.stream import draw_unit
from hose_mj.tasks.task import Task

OPTIONS: dict[str, float | str] = {"graph": "chain", "solver": "variable-elimination", "rounds": 20}
"""The edges: "chain" (neighbours along the hose), "complete", or pairs of agents as in "0-1 0-2";
one of `solvers.SOLVERS`; starts of coordinate ascent, or most rounds of messages of max-plus."""


def make_coordination(
    task: Task, settings: LearnerSettings, options: dict[str, Any]
) -> tuple[Graph, solvers.Scratch]:
    """Makes the graph of some options (see `OPTIONS`), and its work arrays.

    Raises:
        InputError: a wrong option, or settings that a sum over edges does not allow.
    """
    check_settings(task, settings)
    check_choice("solver", options["solver"], solvers.SOLVERS)
    check_range("rounds", options["rounds"], 1, 10**6)
    edges = solvers.read_edges(options["graph"], task.n_agents)
    solver = solvers.SOLVERS[options["solver"]]
    n_agents, n_actions = task.n_agents, task.n_actions
    rounds, eliminates = int(options["rounds"]), solver == solvers.ELIMINATION
    graph = solvers.make_graph(n_agents, n_actions, edges, solver, rounds, eliminates)
    return graph, solvers.make_scratch(graph, n_actions)


def check_settings(task: Task, settings: LearnerSettings) -> None:
    """Raises `InputError` for settings that a sum over the edges of a graph does not allow."""
    if task.n_agents < 2:
        raise InputError("number of agents", task.n_agents, "two or more on a coordination graph")
    if settings.exploration.policy != "epsilon-greedy":
        valid = "'epsilon-greedy' on a coordination graph"
        raise InputError("policy", settings.exploration.policy, valid)
    if MEDIATORS[settings.mediator] != GREATEST_MASS:
        valid = "'greatest-mass' on a coordination graph, which adds up values"
        raise InputError("mediator", settings.mediator, valid)
    for module in settings.modules:
        if module.threshold is not None:
            valid = "None on a coordination graph, where veto modules alone veto"
            raise InputError(f"threshold of module {module.name!r}", module.threshold, valid)


@jitable
def compute_edge_key(graph: Graph, learner: Learner, keys: Integers, edge: int, module: int) -> int:
    """Returns the key of what an edge sees: what its first agent sees, in the edge's own part."""
    agent = graph.edges[edge, 0]
    bases = learner.bases
    seen = keys[agent, module] - bases[module, min(agent, bases.shape[1] - 1)]
    return bases[module, edge] + seen


@jitable
def number_pair(graph: Graph, memory: Memory, edge: int) -> int:
    """Returns the number of the actions a_i, a_j of an edge's agents; the second runs fastest."""
    first = memory.actions[graph.edges[edge, 0]]
    return first * memory.own.scores.shape[0] + memory.actions[graph.edges[edge, 1]]


@jitable
def add_payoffs(graph: Graph, learner: Learner, memory: Memory, module: int) -> None:
    """Adds a module's values in the state that the agents see to the payoffs of all edges."""
    for edge in range(graph.edges.shape[0]):
        key = compute_edge_key(graph, learner, memory.keys, edge, module)
        row = find(memory.table, key)
        for pair in range(graph.sizes[edge]):
            memory.own.values[graph.offsets[edge] + pair] += memory.table.rows[row, pair]


@jitable
def maximize_module(graph: Graph, learner: Learner, memory: Memory, module: int) -> float:
    """Returns max_a' sum_ij Q_ij(s', a'_i, a'_j) of one module; `memory.own.best` is that a'."""
    memory.own.values[:] = 0.0
    add_payoffs(graph, learner, memory, module)
    return solvers.maximize(graph, memory.own, graph.everything, memory.stream)


@jitable
def get_edge_value(graph: Graph, learner: Learner, memory: Memory, edge: int, module: int) -> float:
    """Returns Q_ij(s, a_i, a_j) before the joint move."""
    row = find(memory.table, compute_edge_key(graph, learner, memory.last_keys, edge, module))
    return memory.table.rows[row, number_pair(graph, memory, edge)]


@jitable
def add_to_edge(
    graph: Graph, learner: Learner, memory: Memory, edge: int, module: int, change: float
) -> None:
    """Adds to Q_ij(s, a_i, a_j) before the joint move."""
    row = claim(memory.table, compute_edge_key(graph, learner, memory.last_keys, edge, module))
    memory.table.rows[row, number_pair(graph, memory, edge)] += change


@jitable
def choose_on_graph(rule: Any, task: Any, learner: Learner, memory: Memory, explores: bool) -> None:
    """Chooses a joint action epsilon-greedily, by the sum of all modules and edges (eq. 3.11)."""
    allow_fallbacks(task, learner, memory)
    if explores and draw_unit(memory.stream) < memory.numbers[EPSILON]:
        draw_each(memory)
        return
    memory.own.values[:] = 0.0
    for module in range(learner.bases.shape[0]):
        add_payoffs(rule.graph, learner, memory, module)
    solvers.maximize(rule.graph, memory.own, memory.allowed, memory.stream)
    for agent in range(memory.actions.shape[0]):
        memory.actions[agent] = memory.own.best[agent]
