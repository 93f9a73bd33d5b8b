"""A model as one C99 file without dependencies: no allocation, no loop over terms, the same time at every call."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined

from armloop import __version__
from armloop.export.formula import Formula, formula
from armloop.export.tracing import Node, inputs_used, literal, statements
from armloop.model import ReconstructedModel


def c_source(model: ReconstructedModel) -> tuple[str, Formula]:
    """The text of the C file and its formulas; raises ``ModelError`` for an effect that no formula can say."""
    found = formula(model)
    n = model.arm.n
    states = f"const double q[{n}], const double v[{n}], const double vdot[{n}], double tau[{n}]"
    body, memory_body = _body(found.torque), _body(found.remembered)
    text = _TEMPLATES.get_template("arm.c").render(
        arm=model.arm,
        n=n,
        in_amperes=model.in_amperes,
        found=found,
        stops=len(found.stops),
        torque=f"void armloop_torque({states})",
        torque_memory=f"void armloop_torque_memory(armloop_memory *memory, {states})",
        body=body,
        memory_body=memory_body,
        signs=any("sgn(" in line for line in (*body, *memory_body)),
        version=__version__,
    )
    return text, found


def _body(outputs: list[Node]) -> list[str]:
    lines, results = statements(outputs)
    used = {name.partition("[")[0] for name in inputs_used(outputs)}
    unused = [f"(void){name};" for name in ("q", "v", "vdot") if name not in used]
    return [*lines, *unused, *(f"tau[{j}] = {text};" for j, text in enumerate(results))]


def _comment(text: str) -> str:
    """Text that cannot end a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("\n", " ").replace("\\", "/")


_TEMPLATES = Environment(
    loader=PackageLoader("armloop.export"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_TEMPLATES.filters |= {"comment": _comment, "literal": literal}
