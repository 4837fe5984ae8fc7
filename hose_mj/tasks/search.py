"""Breadth-first search over the states of a compiled task; see `exact.find_shortest`."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from hose_mj.jit import compiled, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import STEPS, Integers

Shorts = npt.NDArray[np.int16]
Slots = npt.NDArray[np.int32]

NOT_FOUND, TOO_MANY = -1, -2


@jitable
def find_slot(states: Shorts, slots: Slots, state: Integers) -> int:
    """Returns the slot of a state, or the free one where it belongs; its step count is left out."""
    mixed = 0
    for k in range(state.shape[0]):
        if k != STEPS:
            mixed = (mixed * 1_000_003 + state[k]) & 0xFFFFFFFFFFF
    slot = (mixed >> 20 ^ mixed) & (slots.shape[0] - 1)
    while slots[slot] >= 0:
        same = True
        for k in range(state.shape[0]):
            same = same and (k == STEPS or states[slots[slot], k] == state[k])
        if same:
            break
        slot = (slot + 1) & (slots.shape[0] - 1)
    return slot


@compiled
def search(task: Any, start: Integers, states: Shorts, slots: Slots, state: Integers) -> int:
    """Returns the moves to the goal; `states` is the queue, in which a step count is a depth."""
    used = 1
    for k in range(start.shape[0]):
        states[0, k] = start[k]
    states[0, STEPS] = 0
    slots[find_slot(states, slots, start)] = 0
    done = 0
    while done < used:
        agent = states[done, kernels.TURN]
        for action in range(task.n_actions):
            for k in range(state.shape[0]):
                state[k] = states[done, k]
            if not kernels.mask(task, state, agent) >> action & 1:
                continue
            events = kernels.apply(task, state, agent, action)
            depth = states[done, STEPS] + 1
            if events & task.success:
                return depth
            if kernels.is_over(task, events):
                continue
            slot = find_slot(states, slots, state)
            if slots[slot] < 0:
                if used == states.shape[0]:
                    return TOO_MANY
                for k in range(state.shape[0]):
                    states[used, k] = state[k]
                states[used, STEPS] = depth
                slots[slot] = used
                used += 1
        done += 1
    return NOT_FOUND
