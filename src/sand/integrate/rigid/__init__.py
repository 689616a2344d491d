"""Motion of rigid clusters: bodies, friction in a gas, touches ahead, and steps of two lengths."""
