import os

# Small matrices on two threads wait for one another. Set here, before anything imports numpy.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")
