"""The paper's own figures, each with its place; nothing else of a reproduction is written down in advance."""

from __future__ import annotations

from armloop.reports import paper as published

#: Fig. 1 and the end of Sect. 2.2: clusters at the elbow; iterations of Algorithm 1 over 20 random starts.
CLUSTERS, RUNS, ITERATIONS_MAX, ITERATIONS_MEAN = 3, 20, 12, 5.75

#: Sect. 2.2, below Fig. 1: h, W₁, W₂ of the indicator, and the noise of v and vdot, dB.
INDICATOR = (60.0, 0.6, 0.32)
SORTING_SNR = (60.0, 50.0)

#: Table 2 (SCARA): optimal orders, candidate functions, samples, seconds of one least-squares calculation.
SCARA_ORDERS = {"sindy": [1, 2], "step1": [1, 0], "step2": [1, 2], "step3": [1, 1]}
SCARA_CANDIDATES = {"sindy": 360, "step1": 8, "step2": 120, "step3": 40}
SCARA_SAMPLES = {"sindy": 10000, "step1": 2000, "step2": 4000, "step3": 4000}
SCARA_SECONDS = {"sindy": 1.48, "step1": 0.0015, "step2": 0.09, "step3": 0.025}
#: Sect. 4.1: fewer candidates, less time, percent.
SCARA_FEWER, SCARA_FASTER = 53.33, 92.13

#: Sect. 4.1, beside Fig. 5: SNR of q, v, vdot in dB, and fewer active terms per joint, percent.
SCARA_SNR = (60.0, 40.0, 20.0)
SCARA_REDUCTION = [87.1, 64.3, 88.6, 88.2]

#: Fig. 8 (blue boxes) and Fig. 9 (three-axis arm); the orders follow from the numbers of candidates.
THREE_AXIS_ORDERS = {"sindy": [4, 2], "step1": [2, 0], "step2": [4, 2], "step3": [4, 1]}
THREE_AXIS_CANDIDATES = {"sindy": 5880, "step1": 28, "step2": 2100, "step3": 840}
#: Sect. 4.2: samples per step, SINDy on all of them; candidates of all steps, fewer by percent; seconds, less by percent.
THREE_AXIS_SAMPLES = {"sindy": 21000, "step1": 1000, "step2": 10000, "step3": 10000}
THREE_AXIS_STEPWISE, THREE_AXIS_FEWER = 2968, 49.52
THREE_AXIS_SECONDS = {"sindy": 499.9, "stepwise": 32.3}
THREE_AXIS_FASTER = 93.54

#: Sect. 4.2, beside Fig. 10: SNR per case and fewer active terms per joint, percent; Case I is said to be "close".
THREE_AXIS_SNR = {"case_1": None, "case_2": (70.0, 50.0, 30.0), "case_3": (60.0, 40.0, 20.0)}
THREE_AXIS_REDUCTION = {"case_2": [75.62, 83.81, 50.00], "case_3": [83.34, 85.57, 85.78]}

#: Sect. 4.3, below Fig. 13: mean absolute tracking error, deg.
ETA_DEG = {name: list(eta) for name, eta in published.ETA_DEG.items()}
