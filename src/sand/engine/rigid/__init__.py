"""The engine of rigid clusters: bodies, the part that is awake, loads of contacts at rest, and substeps."""
