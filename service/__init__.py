"""The surefoot service: HTTP, store, background jobs. Knows `models/`, never the other way."""

import os

# For the libraries below numpy and torch, before anything loads them, and for child processes.
for _name, _value in {
    # Matrices of estimates are small: on more threads OpenBLAS spins rather than works.
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    # oneDNN keeps 1024 compiled kernels, one for each count and length of walks that it met: 85 MB
    # of a worker, and it grew all the while. Compiling them anew costs predictions a twentieth.
    "ONEDNN_PRIMITIVE_CACHE_CAPACITY": "32",
}.items():
    os.environ.setdefault(_name, _value)
