"""The closed loop against the bare plant and against a diagram of Drake's own blocks with the same friction.

All loops run the paper's three-axis arm with sticking Stribeck friction, Eq. (34), at 1 kHz on the reference of Fig.
14. Times are CPU times of one process per simulated second, the best of several rounds in which every loop takes its
turn: only the ratios count, and both sides of a ratio see the same machine.

The native diagram sticks by a second actuator per joint: stiff velocity gains with the Coulomb level as effort limit,
which Drake's discrete solver takes implicitly; the rest of Eq. (34) is a symbolic system. PID is made of gains, adders
and a discrete integrator, the feedforward is `InverseDynamics` of a second plant.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PdControllerGains
from pydrake.symbolic import Variable, exp, tanh
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import InverseDynamics
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Demultiplexer,
    DiscreteTimeIntegrator,
    Gain,
    MatrixGain,
    Multiplexer,
    SymbolicVectorSystem,
    TrajectorySource,
)
from pydrake.trajectories import PiecewisePolynomial
from threadpoolctl import threadpool_limits

from armloop.data.motion import Motion
from armloop.drake import (
    AccelerationGains,
    Feedforward,
    PidGains,
    ReferenceSource,
    add_arm_with_controller,
)
from armloop.drake.experiments.scenarios import load_plant
from armloop.drake.plant.plant import add_links
from armloop.experiment.excitation import paper_reference
from armloop.features.angle_sums import AngleSums
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import SparseTerms
from armloop.reports.tables import table
from armloop.robot.kinematics import nominal_parameters, regressor

SPEC, REFERENCE, N, PERIOD = load_plant("three_axis"), paper_reference(), 3, 1e-3
STICKING_GAIN = 1e5  # N*m*s/rad of the native friction actuator
CALLS = 3000


class Loop:
    """A simulation that can be run again from its start."""

    def __init__(self, builder: DiagramBuilder, plant: MultibodyPlant, start: np.ndarray) -> None:
        self._plant, self._start = plant, start
        self.simulator = Simulator(builder.Build())
        self.context = self.simulator.get_mutable_context()

    def run(self, seconds: float) -> float:
        """CPU milliseconds per simulated second."""
        self.context.SetTime(0.0)
        self._plant.SetPositionsAndVelocities(
            self._plant.GetMyMutableContextFromRoot(self.context), self._start
        )
        self.simulator.Initialize()
        began = time.process_time()
        self.simulator.AdvanceTo(seconds)
        return 1e3 * (time.process_time() - began) / seconds

    @property
    def q(self) -> np.ndarray:
        """Where the arm is."""
        return self._plant.GetPositions(self._plant.GetMyContextFromRoot(self.context))


def start() -> np.ndarray:
    """The state that the reference begins with."""
    q, v, _ = REFERENCE.evaluate([0.0])
    return np.concatenate([q[0], v[0]])


def bare() -> Loop:
    """The plant alone, without friction and drives, swinging about where it hangs, away from its limits."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(PERIOD))
    add_links(plant, SPEC.arm)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    return Loop(builder, plant, np.array([0.0, -1.2, 0.3, 0.0, 0.0, 0.0]))


def native(feedforward: bool) -> Loop:
    """Drake's own blocks only."""
    builder, friction = DiagramBuilder(), SPEC.config.friction
    plant = builder.AddSystem(MultibodyPlant(PERIOD))
    model = MultibodyPlant(0.0)
    for each in (plant, model):
        add_links(each, SPEC.arm)
        for joint, f in zip(SPEC.arm.joints, friction, strict=True):
            each.GetJointByName(joint.name).set_default_damping(f.viscous)
    for joint in SPEC.arm.joints:
        plant.AddJointActuator(f"drive_{joint.name}", plant.GetJointByName(joint.name), joint.effort)
    for joint, f in zip(SPEC.arm.joints, friction, strict=True):
        brake = plant.AddJointActuator(f"friction_{joint.name}", plant.GetJointByName(joint.name), f.coulomb)
        brake.set_controller_gains(PdControllerGains(p=0.0, d=STICKING_GAIN))
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    model.Finalize()
    instance = plant.GetModelInstanceByName(SPEC.arm.name)

    def add(system: Any, *sources: Any) -> Any:
        builder.AddSystem(system)
        for index, source in enumerate(sources):
            builder.Connect(source, system.get_input_port(index))
        return system.get_output_port(0) if system.num_output_ports() == 1 else system

    state = plant.get_state_output_port()
    speeds = [Variable(f"v{i}") for i in range(N)]
    dips = [
        -(f.static - f.coulomb) * exp(-((v / f.stribeck_velocity) ** 2)) * tanh(v / 1e-3)
        for f, v in zip(friction, speeds, strict=True)
    ]
    split = add(Demultiplexer([N, N]), state)
    dip = add(SymbolicVectorSystem(input=speeds, output=dips), split.get_output_port(1))
    builder.Connect(dip, plant.get_applied_generalized_force_input_port())
    still = add(ConstantVectorSource(np.zeros(4 * N)))
    builder.Connect(still, plant.get_desired_state_input_port(instance))

    t = np.arange(0.0, REFERENCE.duration + 0.005, 0.01)
    q, v, _ = REFERENCE.evaluate(t)
    source = add(TrajectorySource(PiecewisePolynomial.CubicHermite(t, q.T, v.T), 2))
    wanted = add(Demultiplexer([2 * N, N]), source)
    error = add(Adder(2, 2 * N), wanted.get_output_port(0), add(Gain(-1.0, 2 * N), state))
    gains = PidGains.paper(N)
    terms = [add(MatrixGain(np.hstack([np.diag(gains.kp), np.diag(gains.kd)])), error)]
    parts = add(Demultiplexer([N, N]), error)
    terms.append(add(Gain(gains.ki), add(DiscreteTimeIntegrator(N, PERIOD), parts.get_output_port(0))))
    if feedforward:
        law = builder.AddSystem(InverseDynamics(model, InverseDynamics.InverseDynamicsMode.kInverseDynamics))
        builder.Connect(wanted.get_output_port(0), law.get_input_port_estimated_state())
        builder.Connect(wanted.get_output_port(1), law.get_input_port_desired_acceleration())
        terms.append(law.get_output_port())
    tau = add(Adder(len(terms), N), *terms)
    both = add(Multiplexer([N, N]), tau, add(ConstantVectorSource(np.zeros(N))))
    builder.Connect(both, plant.get_actuation_input_port(instance))
    loop = Loop(builder, plant, start())
    loop.model = model  # type: ignore[attr-defined]  # the feedforward does not keep it alive
    return loop


def model_of(active: int) -> ReconstructedModel:
    """The plant's exact model in angle sums: the terms that matter most, filled up with what is round-off."""
    revolute = (True,) * N
    sets = [
        AngleSums(revolute, 2, 0, "none"),
        AngleSums(revolute, 4, 2, "velocity"),
        AngleSums(revolute, 4, 1, "acceleration"),
    ]
    q, v, vdot = np.random.default_rng(0).uniform(-2, 2, (3, 2500, N))
    motion = Motion(np.arange(2500.0), q, v, vdot, np.array([0]))
    tau = regressor(SPEC.arm, q, v, vdot) @ nominal_parameters(SPEC.arm)
    columns = [library.columns(motion) for library in sets]
    coefficients = np.linalg.lstsq(np.hstack(columns), tau, rcond=None)[0]
    chosen = np.argsort(-np.abs(coefficients).max(axis=1))[:active]
    parts, first = [], 0
    for step, library in enumerate(sets, 1):
        own = np.sort(chosen[(chosen >= first) & (chosen < first + library.size)]) - first
        parts.append(SparseTerms(step, library.index[own], coefficients[first + own], library.factors.waves))
        first += library.size
    laws = tuple(
        (
            FrictionTerm("sign", f.static),
            FrictionTerm("stribeck", f.coulomb - f.static, f.stribeck_velocity),
            FrictionTerm("viscous", f.viscous),
        )
        for f in SPEC.config.friction
    )
    return ReconstructedModel(SPEC.arm, tuple(parts), FrictionLaw(laws))


def ours(model: ReconstructedModel | None, controller: str = "pid") -> Loop:
    """The loop of `add_arm_with_controller`."""
    builder = DiagramBuilder()
    gains = PidGains.paper(N) if controller == "pid" else AccelerationGains.critical(N)
    loop = add_arm_with_controller(builder, SPEC, gains, REFERENCE, model, controller=controller)
    return Loop(builder, loop.plant.plant, start())


class Empty(LeafSystem):
    """The ports of `Feedforward`; reads them, or not, and gives zero."""

    def __init__(self, reads: bool) -> None:
        super().__init__()
        self._zero = np.zeros(N)
        self._inputs = [self.DeclareVectorInputPort(name, N) for name in ("q_ref", "v_ref", "vdot_ref")]
        sources = {self.all_input_ports_ticket()}
        self.DeclareVectorOutputPort("tau_ff", N, self._read if reads else self._calc, sources)

    def _read(self, context: Any, output: BasicVector) -> None:
        for port in self._inputs:
            port.Eval(context)
        output.SetFromVector(self._zero)

    def _calc(self, context: Any, output: BasicVector) -> None:
        output.SetFromVector(self._zero)


def evaluation(system: LeafSystem) -> Callable[[], float]:
    """A function that measures one evaluation of the output port, us."""
    context = system.CreateDefaultContext()
    inputs = [system.get_input_port(i) for i in range(system.num_input_ports())]
    ports = [port.FixValue(context, np.full(port.size(), 0.3)) for port in inputs]
    output = system.get_output_port(0)

    def measure() -> float:
        began = time.process_time()
        for _ in range(CALLS):
            ports[0].GetMutableData()  # the input counts as changed
            output.Eval(context)
        return 1e6 * (time.process_time() - began) / CALLS

    return measure


def calls(function: Callable[[], object]) -> Callable[[], float]:
    """A function that measures one call, us."""

    def measure() -> float:
        began = time.process_time()
        for _ in range(CALLS):
            function()
        return 1e6 * (time.process_time() - began) / CALLS

    return measure


def best(measured: dict[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    """The least of several rounds of each."""
    least = dict.fromkeys(measured, np.inf)
    for _ in range(rounds):
        for name, measure in measured.items():
            least[name] = min(least[name], measure())
    return least


def ahead(model: ReconstructedModel | None) -> Callable[[], float]:
    """A function that measures what a period of a new `ReferenceSource` costs, its model evaluated ahead, us."""

    def measure() -> float:
        source = ReferenceSource(REFERENCE, PERIOD, model)
        context, output = source.CreateDefaultContext(), source.GetOutputPort("tau_ff")
        began = time.process_time()
        for k in range(2 * CALLS):
            context.SetTime(k * PERIOD)
            output.Eval(context)
        return 1e6 * (time.process_time() - began) / (2 * CALLS)

    return measure


def _simulate(seconds: float) -> float:
    return _shared.run(seconds)


_shared: Loop


def _build() -> None:
    global _shared
    _shared = ours(model_of(50))


def _count(turns: int) -> None:
    """Work that needs neither memory nor any library."""
    x = 0.0
    for k in range(turns):
        x += k * 0.5


def monte_carlo(seconds: float, rounds: int) -> tuple[float, float, float]:
    """Eight equal runs in one forked process and in two, in turns: how many times faster two are.

    By the clock; by the CPU time of a run, which leaves out who else uses the cores; and, by the clock again, of processes
    that only count, what the machine gives two processes now. The best of several turns each.
    """
    fork = multiprocessing.get_context("fork")
    taken, spent, free = ({1: np.inf, 2: np.inf} for _ in range(3))
    with fork.Pool(1, _build) as one, fork.Pool(2, _build) as two:
        for pool, processes in ((one, 1), (two, 2)):
            pool.map(_simulate, [0.1] * 4 * processes, chunksize=1)
        for _ in range(rounds):
            for pool, processes in ((one, 1), (two, 2)):
                began = time.perf_counter()
                times = pool.map(_simulate, [seconds] * 8, chunksize=1)
                taken[processes] = min(taken[processes], time.perf_counter() - began)
                spent[processes] = min(spent[processes], float(np.mean(times)))
                began = time.perf_counter()
                pool.map(_count, [3_000_000] * 4, chunksize=1)
                free[processes] = min(free[processes], time.perf_counter() - began)
    return taken[1] / taken[2], 2 * spent[1] / spent[2], free[1] / free[2]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=1.0, help="simulated seconds per run (default 1)")
    parser.add_argument("--rounds", type=int, default=5, help="turns that every loop takes (default 5)")
    options = parser.parse_args()
    models = {active: model_of(active) for active in (50, 300)}
    loops = {
        "bare plant, no friction": bare(),
        "native: PID": native(False),
        "native: PID + inverse dynamics": native(True),
        "armloop: PID": ours(None),
        "armloop: PID + 50 terms": ours(models[50]),
        "armloop: PID + 300 terms": ours(models[300]),
        "armloop: computed torque, 300 terms": ours(models[300], "computed_torque"),
    }
    runs = best(
        {name: lambda loop=loop: loop.run(options.seconds) for name, loop in loops.items()}, options.rounds
    )
    base, rival = runs["bare plant, no friction"], runs["native: PID + inverse dynamics"]
    rows = [[name, f"{ms:.1f}", f"{ms / base:.1f}", f"{ms / rival:.2f}"] for name, ms in runs.items()]
    title = "CPU time per simulated second, 1 kHz (target: at most 1.30 of native)"
    print(table(["loop", "ms", "x bare plant", "x native with feedforward"], rows, title))
    apart = np.rad2deg(np.abs(loops["native: PID"].q - loops["armloop: PID"].q)).max()
    print(f"after {options.seconds:g} s under PID the two plants are {apart:.4f} deg apart\n")

    systems = {
        "empty system": Empty(False),
        "empty system that reads its inputs": Empty(True),
        "Feedforward of 50 terms": Feedforward(models[50]),
        "Feedforward of 300 terms": Feedforward(models[300]),
        "Feedforward of 300 terms, one port": Feedforward(models[300], stacked=True),
    }
    measures = {name: evaluation(system) for name, system in systems.items()}
    x, drive = np.full(3 * N, 0.3), models[300].stacked_drive()
    measures["300 terms without a system"] = calls(lambda: drive(x))
    measures |= {f"ReferenceSource of {name} terms": ahead(m) for name, m in (("no", None), *models.items())}
    costs = best(measures, 2 * options.rounds)
    empty, reading = (costs[name] for name in ("empty system", "empty system that reads its inputs"))
    rows = [[name, f"{us:.2f}", f"{us - empty:.2f}", f"{us - reading:.2f}"] for name, us in costs.items()]
    title = (
        "One evaluation (target: at most 5 us above empty); the sources evaluate a thousand periods at once"
    )
    print(table(["system", "us", "above empty", "above reading"], rows, title))
    clock, cpu, free = monte_carlo(options.seconds, options.rounds)
    print(
        f"Monte Carlo: two processes are {clock:.2f} times as fast as one (target: 1.80), {cpu:.2f} by CPU time;"
    )
    print(f"two that only count: {free:.2f}. {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
