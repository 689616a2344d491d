"""Forces of a simulation: pair forces, external forces, and a gas."""

BUILT_IN = {
    "Contact": "contact.model",
    "Dipoles": "forces.pair.dipoles",
    "Field": "forces.magnetic_field",
    "Gravity": "forces.gravity",
    "ElectricField": "forces.electric_field",
    "Charges": "forces.pair.inverse_square",
    "Attraction": "forces.pair.inverse_square",
    "ScreenedCharges": "forces.pair.screened_charges",
    "Gas": "forces.gas",
}
"""Names in `sand` of the forces of the package, and their modules; a line here registers a force (`registry`)."""
