"""
Half-speed whirl of a journal
=============================

The probes of a journal above its threshold. A small disturbance grows until the whirl fills the
clearance; one orbit takes two revolutions, so the tacho marks form two groups.
"""

import wearstate

recording = wearstate.simulate("journal-whirl", seed=1)
wearstate.features.orbit(recording).plot()
