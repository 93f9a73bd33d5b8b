"""Coefficients stand in the table with their errors; a model without errors has no table."""

from dataclasses import replace

from armloop.reports.coefficients import coefficients_table, stribeck_table
from armloop_paper.simulated import true_model


def entry(error, freedom=20.0):
    return {"std_error": error, "degrees_of_freedom": freedom}


def test_value_error_t_and_interval_by_hand():
    model = true_model()
    uncertainty = {
        "joints": [{}, {"cos(q2)": entry(0.1)}, {}],
        "friction": [{"v1": entry(0.02), "v_s": entry(0.01)}, {}, {}],
        "shared": {},
        "stribeck": [{"static": {"value": 0.72, **entry(0.004)}}, {}, {}],
    }
    table = coefficients_table(replace(model, uncertainty=uncertainty))
    assert table is not None and len(table.rows) == 2
    # f_v of joint 1 is 2.65; Student's t with 20 degrees of freedom: 2.086
    assert table.rows[0] == ("1", "v1", "2.650 ± 0.020", "132", "2.61 … 2.69", "20.0")
    assert table.rows[1][:2] == ("2", "cos(q2)")
    friction = stribeck_table(replace(model, uncertainty=uncertainty))
    assert friction is not None and friction.rows[0] == ("1", "0.7200 ± 0.0040", "–", "–", "–")


def test_a_model_without_errors_has_no_table():
    assert coefficients_table(true_model()) is None
    assert stribeck_table(true_model()) is None
