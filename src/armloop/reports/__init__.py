"""Reports: tables for the terminal, figures, and pages as one HTML file each.

`tables` needs neither matplotlib nor jinja2; `plots` returns matplotlib figures; `html` renders sections;
`reconstruction_report`, `diagnosis_report` and `loop_report` say what was done, why, and what came out, in sentences of
`templates/*.txt`. All numbers come from the results handed in, and nothing is computed here that a decision depends on.
"""
