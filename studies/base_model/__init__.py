"""The base model: a set network trained once, over many cameras, for cameras never seen."""
