"""Faults and strangers put into recorded tracks: tracks in, tracks out, by a seed and a size.

All have one form, `Injector` of `view`; `catalogue` knows them by name, with a usual size each.
"""
