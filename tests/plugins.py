"""The integrator of `examples/plugins/forest_ruth.py`; it is registered only where a test registers it."""

import sys
from pathlib import Path

from sand.integrate.registry import INTEGRATORS

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "plugins"))
import forest_ruth

sys.path.pop(0)
ForestRuth = forest_ruth.ForestRuth
del INTEGRATORS[ForestRuth.name]
STEPPINGS = {**INTEGRATORS, ForestRuth.name: ForestRuth}
"""The built-in integrators and that of the example, by name."""
