"""Hoses inside an mjModel: composite cable, hinge chain, 1-D flex, and what they share."""
