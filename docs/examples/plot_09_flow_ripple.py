"""
Flow ripple of pumps with one to seven cylinders
================================================

Odd numbers have the least ripple, because their strokes overlap. Ideal pumps, incompressible,
valves without delay.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import crank

cylinders = np.arange(1, 8)
ripple = [crank.flow_ripple(0.2, crank.even_phases(n)) for n in cylinders]

_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.bar(cylinders, [100 * each.total for each in ripple])
axes.set(xlabel="cylinders", ylabel="highest less lowest flow [% of the mean]", yscale="log")
