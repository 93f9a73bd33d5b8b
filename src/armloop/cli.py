"""The command line: parse, call.

Exit status: 0 done; 2 the input is at fault, with one line on standard error; 3 `armloop watch` has a new alarm.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from armloop import __version__
from armloop.errors import InputError

#: In the order of the help. A command `name` is the module armloop.commands.name.
COMMANDS = (
    "loop",
    "collect",
    "excite",
    "cluster",
    "reconstruct",
    "crossvalidate",
    "evaluate",
    "diagnose",
    "track",
    "tune",
    "watch",
    "reproduce",
)


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like those of every other fault."""

    def error(self, message: str) -> None:  # type: ignore[override]
        command = self.prog.removeprefix("armloop").strip()
        raise InputError(f"{command + ': ' if command else ''}{message}; see {self.prog} --help")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status."""
    try:
        options = build_parser().parse_args(arguments)
        status = options.run(options)
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
    return int(status or 0)


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = _Parser(
        prog="armloop",
        description="Measure a robot arm, reconstruct its dynamics, control it, and trace what the model misses.",
        epilog="Start with `armloop loop`. Each command has its own --help.",
    )
    parser.add_argument("--version", action="version", version=f"armloop {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    for name in COMMANDS:
        command = import_module(f"armloop.commands.{name}")
        p = commands.add_parser(
            name,
            help=command.HELP,
            description=command.HELP[0].upper() + command.HELP[1:] + ".",
            epilog=f"Example:\n  {command.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.arguments(p)
        p.set_defaults(run=command.run)
    return parser


if __name__ == "__main__":
    sys.exit(main())
