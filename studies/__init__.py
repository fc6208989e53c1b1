"""Measurements of the product: protocol, faults, alarms, paper, baselines. Nothing imports it."""
