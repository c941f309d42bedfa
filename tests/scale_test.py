#!/usr/bin/env python3
"""Holds the simulator of scripts/scale_sim.py against closed forms. Usage: scale_test.py [PROJECT_ROOT]; fails by an assertion."""
import math
import pathlib
import random
import statistics
import sys

sys.dont_write_bytecode = True
ROOT = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent).resolve()
sys.path.insert(0, str(ROOT / "scripts"))
from scale_model import Node, Rate, Studio, tasks_of  # noqa: E402
from scale_parts import cut, tasks_in_parts  # noqa: E402
from scale_sim import Cluster, Task, critical_path, simulate, with_gates  # noqa: E402


def close(a, b, relative=1e-9):
    assert abs(a - b) <= relative * max(abs(a), abs(b), 1e-12), (a, b)


def random_plan(seed, count=200):
    rng = random.Random(seed)
    return [Task(k, f"s{k % 5}", rng.uniform(1, 100), rng.uniform(0, 1e9), rng.uniform(0, 1e9),
                 tuple(rng.sample(range(1, k), min(k - 1, rng.randrange(4))))) for k in range(1, count + 1)]


def one_node_takes_the_sum():
    tasks = random_plan(1)
    close(simulate(tasks, Cluster()).seconds, sum(t.seconds for t in tasks))
    moved = sum(t.read + t.write for t in tasks)
    run = simulate(tasks, Cluster(shared=2e8, link=1e8, start=0.5))
    close(run.seconds, sum(t.seconds for t in tasks) + moved / 1e8 + 0.5 * len(tasks))
    close(run.busy, run.seconds)
    close(run.in_files, moved / 1e8)


def endless_nodes_take_the_critical_path():
    tasks = random_plan(2)
    close(simulate(tasks, Cluster(nodes=10**6)).seconds, critical_path(tasks))


def some_nodes_keep_grahams_bounds():
    tasks = random_plan(3)
    work, path = sum(t.seconds for t in tasks), critical_path(tasks)
    for nodes in (2, 5, 17):
        seconds = simulate(tasks, Cluster(nodes=nodes)).seconds
        assert max(work / nodes, path) <= seconds <= work / nodes + path * (1 - 1 / nodes) + 1e-6, (nodes, seconds)


def equal_tasks_run_in_rounds():
    tasks = [Task(k, "mask", 7.0) for k in range(1, 101)]
    close(simulate(tasks, Cluster(nodes=8)).seconds, 7.0 * math.ceil(100 / 8))


def parts_do_the_work_of_the_whole():
    """Endless nodes: one part after the first pass, then the join. One node of one core: the sum of all parts."""
    rates = {"mask": Rate(image=0.5, camera_mpx=10.0, footage=1, files=1, spread="cameras")}
    stages = {"mask": ((), True, None)}
    studio = Studio("", cameras=4, fps=10, mpx=1.0, image_bytes=0.0, hours=0.5)  # 18,000 frames: 60 blocks of 150 s
    parts = cut(studio, "mask", rates["mask"], 300.0)
    assert (parts.blocks, parts.at_once, parts.parts, parts.seconds, parts.samples_s) == (60, 2, 30, 300.0, 10.0), parts
    tasks = tasks_in_parts(studio, rates, stages, Node(1, 0.0))
    close(simulate(tasks, Cluster(nodes=10**6)).seconds, 310.0)
    close(simulate(tasks, Cluster()).seconds, 4 * 10.0 + 4 * 30 * 300.0)
    whole = tasks_of(studio, 1, rates, stages, Node(1, 0.0))
    close(simulate(whole, Cluster()).seconds, 4 * 10.0 + 4 * 30 * 300.0)


def files_bound():
    rng = random.Random(4)
    tasks = [Task(k, "pack", 0.0, rng.uniform(1, 9) * 1e8, rng.uniform(1, 9) * 1e8) for k in range(1, 301)]
    close(simulate(tasks, Cluster(nodes=10**6, shared=1e9)).seconds, sum(t.read + t.write for t in tasks) / 1e9)
    largest = max(t.read + t.write for t in tasks)
    close(simulate(tasks, Cluster(nodes=10**6, link=1e8)).seconds, largest / 1e8)


def two_transfers_share_alike():
    # Both read at half the rate until the smaller is done: 2 * 10 s; the other then has 2e9 left at the whole rate.
    tasks = [Task(1, "a", 0.0, 1e9), Task(2, "a", 0.0, 3e9)]
    close(simulate(tasks, Cluster(nodes=2, shared=1e8)).seconds, 40.0)
    tasks = [Task(1, "a", 5.0, 1e9), Task(2, "b", 0.0, 1e9, after=(1,))]
    close(simulate(tasks, Cluster(nodes=2, shared=1e8)).seconds, 25.0)


def gates_wait_for_whole_stages():
    tasks = [Task(1, "a", 1.0), Task(2, "a", 9.0), Task(3, "b", 5.0, after=(1,)), Task(4, "b", 1.0, after=(2,))]
    close(simulate(tasks, Cluster(nodes=4)).seconds, 10.0)
    close(simulate(with_gates(tasks), Cluster(nodes=4)).seconds, 14.0)
    assert simulate(with_gates(tasks), Cluster(nodes=4)).tries == 4


def stragglers_cost_their_share():
    tasks = [Task(k, "mask", 1.0) for k in range(1, 20001)]
    run = simulate(tasks, Cluster(slow_share=0.1, slow_factor=4.0))
    sigma = 3.0 * math.sqrt(0.1 * 0.9 * len(tasks))
    assert abs(run.seconds - 1.3 * len(tasks)) < 4 * sigma, run.seconds


def failures_cost_what_restarts_cost():
    # A task of T seconds that begins again after each failure takes (exp(T / mtbf) - 1) * mtbf on average.
    times = [simulate([Task(1, "mask", 2.0)], Cluster(mtbf=1.5, seed=s)).seconds for s in range(4000)]
    expected = (math.exp(2.0 / 1.5) - 1) * 1.5
    assert abs(statistics.mean(times) - expected) < 4 * statistics.stdev(times) / math.sqrt(len(times)), expected


def a_seed_decides_all():
    tasks, disturbed = random_plan(5), dict(nodes=9, shared=1e9, slow_share=0.1, slow_factor=3.0, mtbf=900.0)
    assert simulate(tasks, Cluster(**disturbed, seed=3)) == simulate(tasks, Cluster(**disturbed, seed=3))
    assert simulate(tasks, Cluster(**disturbed, seed=3)) != simulate(tasks, Cluster(**disturbed, seed=4))


def plans_that_cannot_end_are_refused():
    for tasks in ([Task(1, "a", 1.0, after=(2,)), Task(2, "a", 1.0, after=(1,))], [Task(1, "a", 1.0, after=(7,))]):
        try:
            simulate(tasks, Cluster())
        except ValueError:
            continue
        raise AssertionError("a plan without an end was done")


def main():
    one_node_takes_the_sum()
    endless_nodes_take_the_critical_path()
    some_nodes_keep_grahams_bounds()
    equal_tasks_run_in_rounds()
    parts_do_the_work_of_the_whole()
    files_bound()
    two_transfers_share_alike()
    gates_wait_for_whole_stages()
    stragglers_cost_their_share()
    failures_cost_what_restarts_cost()
    a_seed_decides_all()
    plans_that_cannot_end_are_refused()
    return 0


if __name__ == "__main__":
    sys.exit(main())
