"""Integrators, step-size control, the driver, and the stages that it calls."""

BUILT_IN = {
    "Verlet": "integrate.verlet",
    "RigidClusters": "integrate.rigid.rigid_clusters",
}
"""Names in `sand` of the integrators, and their modules; a line here registers an integrator (`registry`)."""
