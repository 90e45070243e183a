"""The checker of shapes and types while tests run: an int passes for a float, as it does for pyright (PEP 484)."""

from beartype import BeartypeConf, beartype

typecheck = beartype(conf=BeartypeConf(is_pep484_tower=True))
