"""Every module that has moved is still imported by its former name, as the same object, with a warning."""

import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from armloop.moved import MOVED, present_name

ROOT = Path(__file__).resolve().parents[1]
#: Every module as it was called before the move.
FORMER = """
armloop
armloop.api
armloop.api.diagnosis
armloop.api.excitation
armloop.api.model
armloop.api.reading
armloop.api.score
armloop.api.shown
armloop.api.tracking
armloop.arm
armloop.blocks
armloop.cli
armloop.commands
armloop.commands.arguments
armloop.commands.cluster
armloop.commands.collect
armloop.commands.convert
armloop.commands.crossvalidate
armloop.commands.diagnose
armloop.commands.evaluate
armloop.commands.excite
armloop.commands.export
armloop.commands.loop
armloop.commands.next_run
armloop.commands.ranges
armloop.commands.reconstruct
armloop.commands.reproduce
armloop.commands.shared
armloop.commands.track
armloop.commands.tune
armloop.commands.watch
armloop.components
armloop.conditions
armloop.conditions.indicators
armloop.conditions.kmeans
armloop.conditions.sorting
armloop.conditions.study
armloop.convert
armloop.convert.assemble
armloop.convert.convert
armloop.convert.detect
armloop.convert.headers
armloop.convert.joints
armloop.convert.lerobot
armloop.convert.libfranka
armloop.convert.mapping
armloop.convert.matlab
armloop.convert.numpy_archive
armloop.convert.recording
armloop.convert.rosbag
armloop.convert.rtde
armloop.convert.suggest
armloop.convert.table
armloop.convert.text
armloop.convert.units
armloop.design
armloop.design.columns
armloop.design.criteria
armloop.design.data_ratio
armloop.design.excite
armloop.design.information
armloop.design.limits
armloop.design.optimise
armloop.design.random
armloop.design.series
armloop.design.settings
armloop.diagnosis
armloop.diagnosis.account
armloop.diagnosis.alternatives
armloop.diagnosis.apart
armloop.diagnosis.closing
armloop.diagnosis.contacts
armloop.diagnosis.diagnose
armloop.diagnosis.evidence
armloop.diagnosis.fit
armloop.diagnosis.innovations
armloop.diagnosis.judgement
armloop.diagnosis.next_run
armloop.diagnosis.novelty
armloop.diagnosis.outliers
armloop.diagnosis.planning
armloop.diagnosis.pushes
armloop.diagnosis.reasons
armloop.diagnosis.remedies
armloop.diagnosis.reversals
armloop.diagnosis.rivals
armloop.diagnosis.search
armloop.diagnosis.trials
armloop.diagnosis.unlisted
armloop.diagnosis.whereabouts
armloop.drake_systems
armloop.drake_systems.adaptive_feedforward
armloop.drake_systems.beyond_bodies
armloop.drake_systems.bounded_feedforward
armloop.drake_systems.bounded_program
armloop.drake_systems.closed_loop
armloop.drake_systems.collection
armloop.drake_systems.computed_torque
armloop.drake_systems.config
armloop.drake_systems.controllers
armloop.drake_systems.effect_system
armloop.drake_systems.effects
armloop.drake_systems.exact
armloop.drake_systems.feedforward
armloop.drake_systems.forward_dynamics
armloop.drake_systems.friction
armloop.drake_systems.friction_system
armloop.drake_systems.gain_design
armloop.drake_systems.implicit
armloop.drake_systems.joint_loads
armloop.drake_systems.live
armloop.drake_systems.loop_analysis
armloop.drake_systems.metrics
armloop.drake_systems.model_expressions
armloop.drake_systems.nearest_friction
armloop.drake_systems.own_effects
armloop.drake_systems.pickup
armloop.drake_systems.pid
armloop.drake_systems.plant
armloop.drake_systems.rate_limiter
armloop.drake_systems.reference
armloop.drake_systems.replay
armloop.drake_systems.residual_monitor
armloop.drake_systems.scalar_types
armloop.drake_systems.scalars
armloop.drake_systems.scenario_data
armloop.drake_systems.scenario_files
armloop.drake_systems.scenario_references
armloop.drake_systems.scenario_schema
armloop.drake_systems.scenario_types
armloop.drake_systems.scenarios
armloop.drake_systems.scene
armloop.drake_systems.speed_mode
armloop.drake_systems.step_check
armloop.drake_systems.sticking
armloop.drake_systems.tracking
armloop.drake_systems.tuned_loop
armloop.drake_systems.watched_run
armloop.drake_systems.wear
armloop.dynamics
armloop.dynamics.arrays
armloop.dynamics.effects
armloop.dynamics.equations
armloop.dynamics.model
armloop.dynamics.own_effects
armloop.dynamics.physics
armloop.dynamics.rigid
armloop.dynamics.sparse
armloop.effects
armloop.effects.base
armloop.effects.coulomb_friction
armloop.effects.encoder_offset
armloop.effects.events
armloop.effects.external_contact
armloop.effects.external_torque
armloop.effects.friction_asymmetry
armloop.effects.friction_drift
armloop.effects.gravity_tilt
armloop.effects.joint_spring
armloop.effects.law
armloop.effects.listed
armloop.effects.load_dependent_friction
armloop.effects.own
armloop.effects.payload
armloop.effects.presliding_hysteresis
armloop.effects.quadratic_drag
armloop.effects.rotor_inertia
armloop.effects.stribeck_friction
armloop.effects.time_delay
armloop.effects.torque_gain
armloop.effects.torque_offset
armloop.effects.torque_ripple
armloop.effects.transmission_coupling
armloop.effects.viscous_asymmetry
armloop.effects.viscous_friction
armloop.errors
armloop.excitation
armloop.excitation.fourier
armloop.excitation.places
armloop.excitation.ranges
armloop.excitation.reference
armloop.excitation.segments
armloop.excitation.table
armloop.export
armloop.export.c_code
armloop.export.consistent
armloop.export.drake_bundle
armloop.export.export
armloop.export.exported
armloop.export.formula
armloop.export.mjcf
armloop.export.reading_c
armloop.export.rereading
armloop.export.robot_xml
armloop.export.said
armloop.export.tracing
armloop.files
armloop.functions
armloop.goodness
armloop.goodness.features
armloop.goodness.parts
armloop.goodness.ranges
armloop.goodness.regression
armloop.goodness.split
armloop.goodness.witness
armloop.keeping
armloop.kinematics
armloop.library
armloop.library.angle_sums
armloop.library.double_feature_set
armloop.library.friction
armloop.library.harmonics
armloop.library.hysteresis
armloop.library.lagrangian
armloop.library.rigid_body
armloop.library.stribeck
armloop.library.unbiased
armloop.library.wave_moments
armloop.log
armloop.loop
armloop.loop.collecting
armloop.loop.measured
armloop.loop.pickup
armloop.loop.run
armloop.loop.tracking
armloop.loop.tuning
armloop.loop.undeclared
armloop.loop.wear
armloop.model
armloop.monitoring
armloop.monitoring.alarms
armloop.monitoring.blockwise
armloop.monitoring.catalogue
armloop.monitoring.naming
armloop.monitoring.ranks
armloop.monitoring.sums
armloop.monitoring.trend
armloop.monitoring.units
armloop.monitoring.warmth
armloop.motion
armloop.newton_euler
armloop.outputs
armloop.pieces
armloop.plausibility
armloop.pointwise
armloop.progress
armloop.quiet
armloop.reading
armloop.reconstruction
armloop.reconstruction.apart
armloop.reconstruction.bandwidth
armloop.reconstruction.catalogue
armloop.reconstruction.data
armloop.reconstruction.design
armloop.reconstruction.distinct
armloop.reconstruction.excitation
armloop.reconstruction.fitted
armloop.reconstruction.fitting
armloop.reconstruction.found
armloop.reconstruction.friction_ladder
armloop.reconstruction.held_out
armloop.reconstruction.inner_folds
armloop.reconstruction.joint_sums
armloop.reconstruction.judged
armloop.reconstruction.lagrangian
armloop.reconstruction.libraries
armloop.reconstruction.library
armloop.reconstruction.options
armloop.reconstruction.physical
armloop.reconstruction.pooled
armloop.reconstruction.projected
armloop.reconstruction.reconstruct
armloop.reconstruction.refit
armloop.reconstruction.revision
armloop.reconstruction.rigid_body
armloop.reconstruction.ripple
armloop.reconstruction.shared
armloop.reconstruction.sindy
armloop.reconstruction.sorter
armloop.reconstruction.step
armloop.reconstruction.stepwise
armloop.reconstruction.sums
armloop.reconstruction.tally
armloop.reconstruction.torque_checks
armloop.reconstruction.training
armloop.reconstruction.trials
armloop.reconstruction.unattenuated
armloop.registry
armloop.regression
armloop.regression.constrained
armloop.regression.determined
armloop.regression.embedded
armloop.regression.errors_in_variables
armloop.regression.estimators
armloop.regression.estimators.adaptive_lasso
armloop.regression.estimators.debiased_lasso
armloop.regression.estimators.estimator
armloop.regression.estimators.evidence
armloop.regression.estimators.lasso
armloop.regression.estimators.least_squares
armloop.regression.estimators.problem
armloop.regression.estimators.rooted
armloop.regression.estimators.sr3
armloop.regression.estimators.stability
armloop.regression.estimators.stlsq
armloop.regression.estimators.thresholded
armloop.regression.estimators.tuning
armloop.regression.moments
armloop.regression.refined
armloop.regression.sparse
armloop.reports
armloop.reports.coefficients
armloop.reports.crossvalidation
armloop.reports.diagnosis_report
armloop.reports.diagnosis_tables
armloop.reports.excitation_report
armloop.reports.excitation_tables
armloop.reports.findings
armloop.reports.html
armloop.reports.loop_report
armloop.reports.paper
armloop.reports.plots
armloop.reports.plots.conditions
armloop.reports.plots.excitation
armloop.reports.plots.feedforward
armloop.reports.plots.friction
armloop.reports.plots.loops
armloop.reports.plots.orders
armloop.reports.plots.reproduction
armloop.reports.plots.residual
armloop.reports.plots.ring
armloop.reports.plots.shares
armloop.reports.plots.spread
armloop.reports.plots.style
armloop.reports.plots.torque
armloop.reports.plots.tracking
armloop.reports.plots.watch
armloop.reports.reconstruction_report
armloop.reports.reproduction_report
armloop.reports.residuals
armloop.reports.tables
armloop.reports.tracking_tables
armloop.reports.tuning_report
armloop.reports.tuning_tables
armloop.reports.watch_report
armloop.reports.watch_tables
armloop.reports.words
armloop.reproduction
armloop.reproduction.active_terms
armloop.reproduction.beyond_conditions
armloop.reproduction.beyond_coverage
armloop.reproduction.beyond_estimators
armloop.reproduction.beyond_friction
armloop.reproduction.beyond_range
armloop.reproduction.context
armloop.reproduction.estimator_trials
armloop.reproduction.estimators
armloop.reproduction.experiments
armloop.reproduction.fig1
armloop.reproduction.fig10
armloop.reproduction.fig11
armloop.reproduction.fig14
armloop.reproduction.fig15
armloop.reproduction.fig5
armloop.reproduction.fig6
armloop.reproduction.fig8
armloop.reproduction.fig9
armloop.reproduction.gram
armloop.reproduction.lasso
armloop.reproduction.least_squares
armloop.reproduction.methods
armloop.reproduction.noise_study
armloop.reproduction.outcome
armloop.reproduction.paper
armloop.reproduction.readings
armloop.reproduction.registry
armloop.reproduction.sorting_motion
armloop.reproduction.spread
armloop.reproduction.table2
armloop.reproduction.timing
armloop.reproduction.tracking_study
armloop.resources
armloop.sampling
armloop.schemas
armloop.schemas.answers
armloop.schemas.checking
armloop.schemas.model
armloop.schemas.scores
armloop.schemas.tools
armloop.schemas.types
armloop.scoring
armloop.signals
armloop.tables
armloop.uncertainty
armloop.uncertainty.blocking
armloop.uncertainty.coverage
armloop.uncertainty.friction_lines
armloop.uncertainty.sandwich
armloop.uncertainty.simulated
armloop.uncertainty.solving
armloop.uncertainty.standard_errors
armloop.uncertainty.unknowns
armloop.urdf
armloop.validation
armloop.validation.crossvalidate
armloop.validation.physics
armloop.validation.splits
armloop.voices
armloop.watch
armloop.watch.fleet
armloop.watch.ingest
armloop.watch.run
armloop.watch.sources
armloop.watch.store
armloop.watch.verdicts
armloop.wave_table
armloop.workers
""".split()
PROGRAM = """
import json, sys, warnings
from importlib import import_module
wrong = []
for former, present in json.load(sys.stdin).items():
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        module = import_module(former)
    said = [str(each.message) for each in heard if each.category is DeprecationWarning]
    if module is not import_module(present) or module.__spec__.name != present:
        wrong.append(f"{former} is another module than {present}")
    if former != present and not any(f"{former} is now {present};" in each for each in said):
        wrong.append(f"{former}: no warning that names {present}")
print(*wrong, sep="\\n", end="")
"""


def path_of(module: str) -> Path:
    place = ROOT / "src" / Path(*module.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


@pytest.mark.parametrize("module", FORMER)
def test_a_former_name_leads_to_a_module(module: str) -> None:
    assert path_of(present_name(module) or module).is_file()


@pytest.mark.slow
def test_former_names_give_the_same_modules_and_a_warning() -> None:
    names = {module: present_name(module) or module for module in FORMER}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps(names), capture_output=True, text=True, check=True
    )
    assert not done.stdout


def test_a_former_import_statement_works_and_warns_where_it_stands(tmp_path: Path) -> None:
    script = tmp_path / "old.py"
    script.write_text(
        "import armloop.effects.base as base\nfrom armloop.errors import InputError\nprint(base.__name__)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout == "armloop.laws.effects.base\n"
    assert f"{script}:1: DeprecationWarning: armloop.effects is now armloop.laws.effects;" in done.stderr
    assert f"{script}:2: DeprecationWarning: armloop.errors is now armloop.util.errors;" in done.stderr


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("module", ["armloop.nowhere", "armloop.effects.nowhere", "armloop.errors.nowhere"])
def test_a_name_that_never_was_is_not_found(module: str) -> None:
    with pytest.raises(ModuleNotFoundError, match="nowhere"):
        import_module(module)


def test_nothing_of_it_is_loaded_without_a_former_name() -> None:
    program = "import sys, armloop.cli; print('armloop.moved' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_the_page_shows_the_table() -> None:
    page = (ROOT / "docs" / "moved.md").read_text(encoding="utf-8")
    assert dict(re.findall(r"^\| `([\w.]+)` \| `([\w.]+)` \|$", page, re.M)) == MOVED
