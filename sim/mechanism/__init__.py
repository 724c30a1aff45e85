"""Crank mechanism of one to N throws with clearance in its joints, compiled.

Bodies: the crank (one angle ``a``), and per throw a rod (centre of mass ``x_r, y_r`` and angle
``b``) and a piston (``x, y`` and tilt ``t``). Axes: x along the stroke from the crank centre to
the cylinder, y across it. The rod points from the wrist pin to the crank pin along
``e = (-cos b, sin b)``; ``g = de/db = (sin b, cos b)``.

A joint has one of four models. *Ideal*: two constraint forces. *Link*: one constraint force along
a massless link as long as the radial clearance, with friction at its ends; the pin never leaves
its eye, and tension in the link indicates that it would. *Compliant*: the contact force of a law
if the pin overlaps its eye, zero in free flight. *Oiled*: a film on a yielding wall, without events
(:mod:`.mechanism.oiled_joint`). An ideal guide holds ``y = t = 0``; a compliant
one has a clearance on either side and touches the piston at its four corners.

For a pin at ``d`` from the centre of its eye, with direction ``n`` and ``t`` a quarter turn
further, the force on the rod is ``F_n n + F_t t``, where ``F_t`` follows the sliding velocity
``v_t = d' . t + r_pin w_pin + r_eye b'`` (the rod turns at ``-b'``), so that friction dissipates
energy; the printed signs of the source paper add energy. Newton's and Euler's equations of each
body are explicit except for the constraint forces, which solve a linear system of up to four
unknowns per throw; Baumgarte's terms limit drift. With a motor the crank's acceleration enters
every throw's constraints linearly, so that it too has a closed form.

Classical Runge-Kutta with a fixed step; a step in which a contact closes or opens is cut there, so
that the order is kept across contact. Forces are recorded as means over the step, that is as exact
impulses, regardless of contact changes within the step. A chamber with valves is stepped after the
mechanism, which uses its pressure extrapolated from the last two steps (second order). If the
throws share two lines, the step of all chambers is repeated until the pressures at the lines' ends
match the flow that the pump draws (:mod:`wearstate.sim.piping.coupling`).

Sources: Xia, Zhang, Yu, Zhu (2017), Ship Science and Technology 39(1), 51-55; Baumgarte (1972),
doi:10.1016/0045-7825(72)90018-7.

It may import ``sim.jit``, ``sim.output``, ``sim.contact``, ``sim.film``, ``sim.hydraulics``,
``sim.piping``.
"""
