"""The contact model: contact laws, and the loops that update, form, slip and break contacts."""
