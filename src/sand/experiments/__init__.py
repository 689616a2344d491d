"""Published figures and common measurements, each as one function."""
