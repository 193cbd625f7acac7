"""Parametric actuators with named parts, cavities, mounts and markers."""
