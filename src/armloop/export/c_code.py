"""A model as one C99 file without dependencies: no allocation, no loop over terms, the same time at every call."""

from __future__ import annotations

from armloop import __version__
from armloop.export.formula import Formula, formula
from armloop.export.tracing import Node, inputs_used, literal, statements
from armloop.model import ReconstructedModel

_HEAD = """\
/* Inverse dynamics of {name}: the torques its drives must supply, as armloop {version} reconstructed them.
 *
 *   cc -std=c99 -O2 -c this_file.c        (link with -lm)
 *
 * void armloop_torque(const double q[{n}], const double v[{n}], const double vdot[{n}], double tau[{n}])
 *
 * Joints, base to tip, with the units of q and tau (v and vdot per s and s^2):
{joints}
 *
 * C99 without allocation and without loops whose length depends on data: bounded time. Reentrant.
{notes} */
"""


def c_source(model: ReconstructedModel) -> tuple[str, Formula]:
    """The text of the C file, and the formulas in it.

    Raises:
        ModelError: the model has an effect that no formula can say.
    """
    found = formula(model)
    n, arm = model.arm.n, model.arm
    joints = "\n".join(
        f" *   {j}  {_comment(joint.name)}: {joint.position_unit}, {joint.torque_unit.replace('*', '.')}"
        for j, joint in enumerate(arm.joints)
    )
    notes = "".join(f" * Not in it: {_comment(line)}.\n" for line in found.left_out)
    if model.in_amperes:
        notes += " * tau is the motor current in A: the model was made of currents.\n"
        joints = joints.replace("N.m", "A")
    if found.has_memory:
        notes += " * Friction with memory is fully slid, and friction that fades gone, in armloop_torque;\n"
        notes += " * armloop_torque_memory carries them along in a struct of the caller's.\n"
    parts = [
        _HEAD.format(name=_comment(arm.name), version=__version__, n=n, joints=joints, notes=notes),
        "#include <math.h>\n",
        f"#define ARMLOOP_JOINTS {n}\n",
        f"void armloop_torque(const double q[{n}], const double v[{n}], const double vdot[{n}], double tau[{n}]);",
    ]
    if found.has_memory:
        parts += _memory_head(found, n)
    outputs = [*found.torque, *(found.remembered if found.has_memory else [])]
    if any("sgn(" in line for line in [*statements(outputs)[0], *statements(outputs)[1]]):
        parts.append("\nstatic double sgn(double x) { return (double)((x > 0.0) - (x < 0.0)); }")
    parts.append(
        f"\nvoid armloop_torque(const double q[{n}], const double v[{n}], const double vdot[{n}], double tau[{n}])\n{{"
    )
    parts += _body(found.torque)
    parts.append("}")
    if found.has_memory:
        parts += _memory_body(found, n)
    return "\n".join(parts) + "\n", found


def _body(outputs: list[Node]) -> list[str]:
    lines, results = statements(outputs)
    used = {name.partition("[")[0] for name in inputs_used(outputs)}
    unused = [f"(void){name};" for name in ("q", "v", "vdot") if name not in used]
    results = [f"tau[{j}] = {text};" for j, text in enumerate(results)]
    return ["    " + line for line in [*lines, *unused, *results]]


def _memory_head(found: Formula, n: int) -> list[str]:
    count = len(found.stops)
    fields = ["int started;  /* 0 before the first sample */"]
    if found.fades:
        fields.append("double t;     /* s since the joints were started; set it before each call */")
    if count:
        fields += [f"double q[{n}];", f"double z[{count}];  /* stretch of each element, from -1 to 1 */"]
    return [
        "\n/* What friction remembers. armloop_reset relaxes it; then call armloop_torque_memory sample by sample. */",
        "typedef struct {",
        *("    " + field for field in fields),
        "} armloop_memory;\n",
        "void armloop_reset(armloop_memory *memory);",
        f"void armloop_torque_memory(armloop_memory *memory, const double q[{n}], const double v[{n}], "
        f"const double vdot[{n}], double tau[{n}]);",
    ]


def _memory_body(found: Formula, n: int) -> list[str]:
    count = len(found.stops)
    lines = ["\nvoid armloop_reset(armloop_memory *memory)", "{"]
    if count:
        lines.append("    int k;")
    lines.append("    memory->started = 0;")
    if found.fades:
        lines.append("    memory->t = 0.0;")
    if count:
        lines += [
            f"    for (k = 0; k < {n}; ++k) memory->q[k] = 0.0;",
            f"    for (k = 0; k < {count}; ++k) memory->z[k] = 0.0;",
        ]
    lines += [
        "}",
        f"\nvoid armloop_torque_memory(armloop_memory *memory, const double q[{n}], const double v[{n}], "
        f"const double vdot[{n}], double tau[{n}])",
        "{",
    ]
    if count:
        joints = ", ".join(str(stop.joint) for stop in found.stops)
        widths = ", ".join(literal(stop.width) for stop in found.stops)
        lines += [
            f"    static const int joint[{count}] = {{{joints}}};",
            f"    static const double width[{count}] = {{{widths}}};",
            "    double *z = memory->z;",
            "    int k;",
        ]
    if found.fades:
        lines.append("    const double t = memory->t;")
    if count:
        lines += [
            f"    for (k = 0; memory->started && k < {count}; ++k) {{",
            "        const double x = z[k] + (q[joint[k]] - memory->q[joint[k]]) / width[k];",
            "        z[k] = x > 1.0 ? 1.0 : (x < -1.0 ? -1.0 : x);",
            "    }",
            f"    for (k = 0; k < {n}; ++k) memory->q[k] = q[k];",
        ]
    lines.append("    memory->started = 1;")
    lines.append("    {")
    lines += ["    " + line for line in _body(found.remembered)]
    lines += ["    }", "}"]
    return lines


def _comment(text: str) -> str:
    """Text that cannot end a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("\n", " ").replace("\\", "/")
