"""The command line: parse, call, print.

Exit status: 0 done; 2 the input is at fault, with one line on standard error. Nothing heavy is imported
before a command runs, so that ``--help`` and wrong arguments answer at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module

from armloop import __version__
from armloop.errors import InputError

_LOG_HELP = "motion logs, CSV or Parquet: time,q1..qn,v1..vn,tau1..taun (SI units; joints base to tip)"
_ARM_HELP = "a built-in arm (three_axis, scara) or the path of a URDF"


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like those of every other fault."""

    def error(self, message: str) -> None:  # type: ignore[override]
        command = self.prog.removeprefix("armloop").strip()
        raise InputError(f"{command + ': ' if command else ''}{message}; see {self.prog} --help")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status."""
    try:
        options = build_parser().parse_args(arguments)
        command: Callable[[argparse.Namespace], None] = getattr(
            import_module("armloop.commands"), options.command
        )
        command(options)
    except InputError as error:
        print(f"armloop: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # Whoever read the answer (head, a pager) has had enough; Python would complain again at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        print("armloop: interrupted", file=sys.stderr)
        return 130
    return 0


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = _Parser(
        prog="armloop",
        description="Measure a robot arm, reconstruct its dynamics, control it, and trace what the model misses.",
        epilog="Start with `armloop loop`. Each command has its own --help.",
    )
    parser.add_argument("--version", action="version", version=f"armloop {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    _loop(commands)
    _collect(commands)
    _cluster(commands)
    _reconstruct(commands)
    _evaluate(commands)
    _diagnose(commands)
    _track(commands)
    return parser


def _command(commands: argparse._SubParsersAction[_Parser], name: str, does: str, example: str) -> _Parser:
    """One subcommand whose help shows an example."""
    return commands.add_parser(
        name,
        help=does,
        description=does[0].upper() + does[1:] + ".",
        epilog=f"Example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def _loop(commands: argparse._SubParsersAction[_Parser]) -> None:
    p = _command(
        commands,
        "loop",
        "the main job: collect, reconstruct, track, measure again, find the undeclared effect, add it, track again",
        "armloop loop --out out/loop",
    )
    p.add_argument(
        "--out", default="out/loop", help="folder for report.html, loop.json, logs, models (%(default)s)"
    )
    p.add_argument(
        "--seed", type=_seed, default=1, help="draws the data and the undeclared effect (%(default)s)"
    )


def _collect(commands: argparse._SubParsersAction[_Parser]) -> None:
    p = _command(
        commands,
        "collect",
        "simulate the paper's data collection in Drake, one log per condition",
        "armloop collect three_axis --out out/logs --seed 3",
    )
    p.add_argument("arm", help=_ARM_HELP)
    p.add_argument("--out", required=True, help="folder for the logs")
    p.add_argument(
        "--plan",
        default="paper",
        help="a plan of scenarios/collection.yaml (paper, dwell, quick: closed loop on the plant with friction), or "
        "`simulation`: friction-free inverse dynamics with the paper's numbers of samples (%(default)s)",
    )
    p.add_argument("--seed", type=_seed, default=1, help="(%(default)s)")


def _logs(p: _Parser) -> None:
    p.add_argument("logs", nargs="+", metavar="LOG", help=_LOG_HELP)


def _recorded(p: _Parser, default: str) -> None:
    p.add_argument(
        "--tau-unit",
        choices=("N*m", "A"),
        default=None,
        help=f"what the columns tau hold (default: {default})",
    )
    p.add_argument(
        "--drive-gains",
        default=None,
        metavar="K1,..,KN",
        help=f"N·m/A per joint: turns motor currents into torques (default: {default})",
    )


def _seed(text: str) -> int:
    """A seed of a random generator, from 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no seed; give a whole number from 0")
    return int(text)


def _json(p: _Parser) -> None:
    p.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def _cluster(commands: argparse._SubParsersAction[_Parser]) -> None:
    p = _command(
        commands,
        "cluster",
        "sort samples into static, constant-velocity and varying-velocity data",
        "armloop cluster out/logs/*.csv",
    )
    _logs(p)
    p.add_argument(
        "--indicator",
        choices=("robust", "paper"),
        default="robust",
        help="the paper's relative activation indicator, or one whose switch follows the noise (%(default)s)",
    )
    p.add_argument("--seed", type=_seed, default=0, help="of k-means (%(default)s)")
    _json(p)


def _reconstruct(commands: argparse._SubParsersAction[_Parser]) -> None:
    p = _command(
        commands,
        "reconstruct",
        "reconstruct a readable model of the joint torques from logs",
        "armloop reconstruct out/logs/*.csv --arm three_axis --out model.json",
    )
    _logs(p)
    p.add_argument("--arm", required=True, help=_ARM_HELP)
    p.add_argument("--out", required=True, help="the model file, JSON")
    p.add_argument(
        "--method", default="stepwise", help="stepwise, or sindy: the one-shot baseline (%(default)s)"
    )
    p.add_argument(
        "--library",
        default=None,
        help="double-feature-set (default up to four joints), rigid-body (default beyond; base parameters of the "
        "URDF's chain) or lagrangian (few terms of the energies, found without the URDF's lengths)",
    )
    p.add_argument(
        "--estimator",
        default="lasso_ebic",
        help="how terms are chosen: lasso_ebic (Lasso path, information criterion, swap search), lasso (Eq. 32 with "
        "--penalty) or least_squares (%(default)s)",
    )
    p.add_argument("--penalty", type=float, default=1e-3, help="λ of --estimator lasso (%(default)s)")
    p.add_argument("--max-order", type=int, default=4, help="largest truncation order N1 tried (%(default)s)")
    p.add_argument(
        "--cutoff", type=float, default=None, help="low-pass in Hz, 0 for none (default: by library)"
    )
    p.add_argument("--report", default=None, metavar="HTML", help="also write a report with plots")
    _recorded(p, "N*m")
    _json(p)


def _evaluate(commands: argparse._SubParsersAction[_Parser]) -> None:
    p = _command(
        commands,
        "evaluate",
        "compare a model's prediction with logs: RMSE and nRMSE (RMSE over RMS of the measured signal) per joint",
        "armloop evaluate model.json run.csv",
    )
    p.add_argument("model", metavar="MODEL.json")
    _logs(p)
    p.add_argument("--arm", default=None, help="refuse the model unless it was made for this arm")
    _recorded(p, "as the model's training logs")
    _json(p)


def _diagnose(commands: argparse._SubParsersAction[_Parser]) -> None:
    p = _command(
        commands,
        "diagnose",
        "find what a model lacks on a measured run, trace it to a physical effect, and add it",
        "armloop diagnose model.json run.csv --out out/diagnosis",
    )
    p.add_argument("model", metavar="MODEL.json")
    _logs(p)
    p.add_argument(
        "--out", required=True, help="folder for diagnosis.json, model.json (augmented), report.html"
    )
    p.add_argument("--arm", default=None, help="refuse the model unless it was made for this arm")
    _recorded(p, "as the model's training logs")
    _json(p)


def _track(commands: argparse._SubParsersAction[_Parser]) -> None:
    p = _command(
        commands,
        "track",
        "compare controllers in closed loop in Drake: mean absolute tracking error per joint",
        "armloop track three_axis_tracking --model step1=model.json --model step3=model.json --out out/track",
    )
    p.add_argument(
        "scenario", metavar="SCENARIO", help="a built-in scenario (three_axis_tracking) or a YAML file"
    )
    p.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="NAME=MODEL.json",
        help="step1 and step3 are the feedforwards of pid_step1 and pid_step3, `model` serves both; any other NAME "
        "adds a controller pid_NAME. Without any, a model is reconstructed from data collected on the "
        "scenario's arm first",
    )
    p.add_argument("--out", default=None, help="folder for tracking.json, plots and replay.html")
    _json(p)


if __name__ == "__main__":
    sys.exit(main())
