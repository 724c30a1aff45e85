"""
Contact laws give other restitutions than asked
===============================================

Hysteresis laws of impact: the restitution that a free impact has over the one asked for. Of
these, only the exact law keeps its word.
"""

import numpy as np
from matplotlib import pyplot as plt
from wearstate import contact

asked = np.linspace(0.34, 1.0, 40)
_, axes = plt.subplots(figsize=(6, 5), layout="constrained")
for law in ("exact", "hunt-crossley", "lankarani-nikravesh", "flores", "gonthier"):
    given = [contact.effective_restitution(contact.hysteresis(law, e)) for e in asked]
    axes.plot(asked, given, label=law)
axes.set(xlabel="restitution asked for [-]", ylabel="restitution given [-]")
axes.legend()
