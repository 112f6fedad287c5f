"""fsoe-net: check, compile, run and emulate FSoE (Safety over EtherCAT) networks.

The package is built in layers, lowest first: ``diag`` and ``errors``, ``fsoe``, ``model``,
``load``, ``rules``, ``plan``, ``core`` and ``emul``, ``run``, ``report``, ``cli``. Each imports
only what stands below it.

Part of the black channel, not certified, never a safety function.
"""

__version__ = "0.1.0"

__all__ = ["__version__"]
