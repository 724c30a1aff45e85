"""
Specified and actual restitution of contact laws
================================================

Hysteresis laws of impact: restitution of a free impact over the specified one. Of these, only the
exact law gives the specified value.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import contact

specified = np.linspace(0.34, 1.0, 40)
_, axes = plt.subplots(figsize=(6, 5), layout="constrained")
for law in ("exact", "hunt-crossley", "lankarani-nikravesh", "flores", "gonthier"):
    actual = [contact.effective_restitution(contact.hysteresis(law, e)) for e in specified]
    axes.plot(specified, actual, label=law)
axes.set(xlabel="specified restitution [-]", ylabel="actual restitution [-]")
axes.legend()
