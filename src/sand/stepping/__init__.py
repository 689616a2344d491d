"""How time goes on: the compiled driver of many steps, the choice of the step, the integrators."""
