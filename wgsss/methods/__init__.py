"""The methods, each in a module of its own. `wgsss.registry` has their names."""

from __future__ import annotations

from wgsss.methods.method import Diffused, Method

__all__ = ["Diffused", "Method"]
