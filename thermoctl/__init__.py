"""Real-time adaptive temperature controller.

The house is described in ``docs/architecture.md``; one sample's walk through it starts in
:mod:`thermoctl.runtime.loop`.
"""

__version__ = "0.1.0"
