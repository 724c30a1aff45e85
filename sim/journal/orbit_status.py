"""How a run of a journal ended, with the cure."""

from ..output.status import Ending


class OrbitStatus(Ending):
    """How a run ended. Every status except OK includes a cure."""

    OK = 0, "done"
    DIVERGED = 1, "the state is no longer finite; shorten the step"
    STEP = (
        2,
        "the step is too long for the squeeze stiffness of the film, which limits an explicit "
        "integrator; shorten the step, or choose the integrator 'adaptive'",
    )
    THIN = (
        3,
        "the journal came nearer to the wall than the film's mesh or map resolves; refine the mesh "
        "and raise last_eccentricity, or add a wall",
    )
    OVERLOAD = (
        4,
        "the steady load on the journal exceeds the capacity of the film at its last "
        "eccentricity; lower the load, raise speed, viscosity or length, or add a wall",
    )
    CONTACT = 5, "the journal touches its bearing; add a wall with a contact law, or lower the load"
    OVERLAP = (
        6,
        "the journal sinks into the wall by more than a tenth of the clearance, beyond the contact "
        "law; raise the stiffness of the wall",
    )
    FILM = (
        7,
        "the direct solver of the film found no pressure where the journal went, as where it "
        "touches a bump in the bore; check bore and grooves, or lower the load",
    )
    STEPS = 8, "the adaptive integrator reached max_steps; raise it, or loosen the tolerance"
    UNSETTLED = (
        9,
        "the end of a step was not found, as film and journal change too much in it; shorten "
        "the step, or refine the mesh",
    )
