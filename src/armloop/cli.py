"""The command line: parse, call.

Exit status: 0 done; 2 the input is at fault; 1 something else is (memory, a process killed); 130 Ctrl-C; 143 SIGTERM;
with one line on standard error. 3 `armloop watch` has a new alarm.
"""

from __future__ import annotations

import argparse
import codecs
import errno
import io
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from armloop import __version__
from armloop.commands.options import Options
from armloop.util.doubts import gathered, listening
from armloop.util.errors import InputError, one_line
from armloop.util.outputs import guarding
from armloop.util.quiet import quiet

#: In the order of the help. A command `name` is the module armloop.commands.name, its options the class Name in it.
COMMANDS = (
    "loop",
    "collect",
    "convert",
    "excite",
    "cluster",
    "reconstruct",
    "crossvalidate",
    "evaluate",
    "diagnose",
    "export",
    "track",
    "tune",
    "watch",
    "reproduce",
)


#: A file that was opened and cannot hold more: the disk, or what its owner may use of it.
_FULL = (errno.ENOSPC, errno.EDQUOT)
NO_MEMORY = "not enough memory for this; give shorter logs, fewer terms or a lower order"


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like those of every other fault."""

    def error(self, message: str) -> None:  # type: ignore[override]
        command = self.prog.removeprefix("armloop").strip()
        raise InputError(f"{command + ': ' if command else ''}{message}; see {self.prog} --help")


class _Command(_Parser):
    """The parser of one command, which learns its options when it is called: the help of all names them not."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self.learn()
        found, others = super().parse_known_args(args, namespace)
        if others:  # said here, where the command's own help is named
            self.error(f"unrecognized arguments: {' '.join(others)}")
        return found, others

    def learn(self) -> None:
        """Declare the command's options."""
        name = self.prog.split()[-1]
        command = import_module(f"armloop.commands.{name}")
        kind = getattr(command, name.capitalize())
        kind.declare(self)
        self.set_defaults(run=command.run, kind=kind)


class _Help(argparse.HelpFormatter):
    """Sentences are wrapped to the terminal, examples stay as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n" in text else super()._fill_text(text, width, indent)


class _Completion(argparse.Action):
    """Print a shell's completion of all commands and options, and end."""

    def __call__(self, parser: argparse.ArgumentParser, *values: Any) -> None:
        import shtab

        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for command in action.choices.values():
                    command.learn()
                    for option in command._actions:  # whatever has no choices of its own may be a path
                        if option.nargs != 0 and not option.choices:
                            option.complete = shtab.FILE
        _, shell, *_ = values
        print(shtab.complete(parser, shell=str(shell)))
        parser.exit()


#: Signs of tables and sentences, and what stands for them where an encoding has none of them; ─ keeps its width.
_PLAIN = dict(zip("─·–−…°±→×²³η√π", "- * - - .. deg +- -> x ^2 ^3 eta sqrt pi".split(), strict=True))


def _spelt_out(error: UnicodeError) -> tuple[str | bytes, int]:
    """What an encoding lacks in signs that it has; letters of a name as Python's escapes."""
    if isinstance(error, UnicodeEncodeError) and error.object[error.start] in _PLAIN:
        return _PLAIN[error.object[error.start]], error.start + 1
    return codecs.backslashreplace_errors(error)


class _Ended(BaseException):
    """The process was asked to end (SIGTERM); not an Exception, so that nothing takes it for a fault."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            codecs.register_error("spelt_out", _spelt_out)
            stream.reconfigure(errors="spelt_out")
    try:
        # whose cache of fonts has no place to be kept, as where a container has no home, plots as well without
        with listening() as doubts, _ending_on_request(), quiet("matplotlib"):
            given = build_parser().parse_args(arguments)
            options = given.kind(vars(given))
            with guarding(options.command, _named_files(options), options.force):
                status = given.run(options)
        for doubt in gathered(doubts):
            print(f"armloop: warning: {doubt}", file=sys.stderr)
    except InputError as error:
        return _fault(str(error), 2)
    except BrokenPipeError:
        # Whoever read the answer (head, a pager) has had enough; Python would complain again at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        place = f"{error.filename}: " if error.filename is not None else ""
        mend = (
            "make room, or write elsewhere"
            if error.errno in _FULL
            else "check that it is there and may be used"
        )
        return _fault(f"{place}{error.strerror or error}; {mend}", 2)
    except MemoryError:
        return _fault(NO_MEMORY, 1)
    except RuntimeError as error:
        if type(error).__name__ != "BrokenProcessPool":
            raise
        return _fault("a worker process was ended from outside, perhaps for want of memory; run again", 1)
    except (KeyboardInterrupt, _Ended, ImportError) as error:
        ended = _end_of(error)
        if ended is None and isinstance(error, ImportError) and "failed to map" in str(error):
            return _fault(NO_MEMORY, 1)
        if ended is None:
            raise
        return ended
    return int(status or 0)


def _end_of(error: BaseException | None) -> int | None:
    """Exit status of a command that was asked to end, which a compiled module's import calls an ``ImportError``; or None."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return _fault("interrupted", 130)
        if isinstance(error, _Ended):
            return _fault("ended on request (SIGTERM)", 143)
        error = error.__cause__ or error.__context__
    return None


def _fault(message: str, status: int) -> int:
    print(f"armloop: {one_line(message)}", file=sys.stderr)
    return status


@contextmanager
def _ending_on_request() -> Iterator[None]:
    """Take SIGTERM for an exception, so that drafts are removed and worker processes end."""

    def end(*_: object) -> None:
        raise _Ended

    try:
        before = signal.signal(signal.SIGTERM, end)
    except ValueError:  # not the main thread: signals are somebody else's
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


#: Options that name what is written; every other file on a command line is read.
_WRITTEN = {"out", "report", "next_run", "store"}


def _named_files(options: Options) -> list[str]:
    """Files that the command line names as inputs: LOG, NAME=MODEL.json, FILE:NAME."""
    found = []
    for name, value in vars(options).items():
        for each in value if isinstance(value, list) else [value]:
            if name not in _WRITTEN and isinstance(each, str):
                found += [part for part in (each, each.partition("=")[2], each.rpartition(":")[0]) if part]
    return [path for path in found if os.path.isfile(path)]


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = _Parser(
        prog="armloop",
        description="Measure a robot arm, reconstruct its dynamics, control it, and trace what the model misses.",
        epilog="Start with `armloop loop`. Each command has its own --help.",
    )
    parser.add_argument("--version", action="version", version=f"armloop {__version__}")
    parser.add_argument(
        "--print-completion",
        action=_Completion,
        choices=("bash", "zsh", "tcsh"),
        help='what your shell completes with: eval "$(armloop --print-completion bash)" in ~/.bashrc',
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Command)
    for name in COMMANDS:
        command = import_module(f"armloop.commands.{name}")
        commands.add_parser(
            name,
            help=command.HELP,
            description=command.HELP[0].upper() + command.HELP[1:] + ".",
            epilog=f"Example:\n  {command.EXAMPLE}",
            formatter_class=_Help,
        )
    return parser


if __name__ == "__main__":
    sys.exit(main())
