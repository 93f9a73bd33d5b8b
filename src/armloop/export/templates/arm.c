/* Inverse dynamics of {{ arm.name | comment }}: the torques its drives must supply, as armloop {{ version }} reconstructed them.
 *
 *   cc -std=c99 -O2 -c this_file.c        (link with -lm)
 *
 * {{ torque }}
 *
 * Joints, base to tip, with the units of q and tau (v and vdot per s and s^2):
{% for joint in arm.joints %}
 *   {{ loop.index0 }}  {{ joint.name | comment }}: {{ joint.position_unit }}, {{ "A" if in_amperes else joint.torque_unit | replace("*", ".") }}
{% endfor %}
 *
 * C99 without allocation and without loops whose length depends on data: bounded time. Reentrant.
{% for line in found.left_out %}
 * Not in it: {{ line | comment }}.
{% endfor %}
{% if in_amperes %}
 * tau is the motor current in A: the model was made of currents.
{% endif %}
{% if found.has_memory %}
 * Friction with memory is fully slid, and friction that fades gone, in armloop_torque, which is what a controller
 * feeds forward; armloop_torque_memory carries them along in a struct of the caller's, as a log of the motion shows them.
{% endif %}
 */

#include <math.h>

#define ARMLOOP_JOINTS {{ n }}

{{ torque }};
{% if found.has_memory %}

/* What friction remembers. armloop_reset relaxes it; then call armloop_torque_memory sample by sample. */
typedef struct {
    int started;  /* 0 before the first sample */
{% if found.fades %}
    double t;     /* s since the joints were started; set it before each call */
{% endif %}
{% if stops %}
    double q[{{ n }}];
    double z[{{ stops }}];  /* stretch of each element, from -1 to 1 */
{% endif %}
} armloop_memory;

void armloop_reset(armloop_memory *memory);
{{ torque_memory }};
{% endif %}
{% if signs %}

static double sgn(double x) { return (double)((x > 0.0) - (x < 0.0)); }
{% endif %}

{{ torque }}
{
{% for line in body %}
    {{ line }}
{% endfor %}
}
{% if found.has_memory %}

void armloop_reset(armloop_memory *memory)
{
{% if stops %}
    int k;
{% endif %}
    memory->started = 0;
{% if found.fades %}
    memory->t = 0.0;
{% endif %}
{% if stops %}
    for (k = 0; k < {{ n }}; ++k) memory->q[k] = 0.0;
    for (k = 0; k < {{ stops }}; ++k) memory->z[k] = 0.0;
{% endif %}
}

{{ torque_memory }}
{
{% if stops %}
    static const int joint[{{ stops }}] = { {{- found.stops | map(attribute="joint") | join(", ") -}} };
    static const double width[{{ stops }}] = { {{- found.stops | map(attribute="width") | map("literal") | join(", ") -}} };
    double *z = memory->z;
    int k;
{% endif %}
{% if found.fades %}
    const double t = memory->t;
{% endif %}
{% if stops %}
    for (k = 0; memory->started && k < {{ stops }}; ++k) {
        const double x = z[k] + (q[joint[k]] - memory->q[joint[k]]) / width[k];
        z[k] = x > 1.0 ? 1.0 : (x < -1.0 ? -1.0 : x);
    }
    for (k = 0; k < {{ n }}; ++k) memory->q[k] = q[k];
{% endif %}
    memory->started = 1;
    {
{% for line in memory_body %}
        {{ line }}
{% endfor %}
    }
}
{% endif %}
