"""The kinds of recordings: what each does, and which words of a message name its cause."""

import dataclasses
import re


@dataclasses.dataclass
class Kind:
    name: str
    group: str
    make: object               # rng -> Recording
    names: list                # a message that matches one of them names the cause
    clean: bool = False        # nothing is wrong: a warning is a false one
    statistics: bool = False   # its z-scores count in the coverage of the stated sigmas
    simpler: tuple = ("brown2", "brown1", "pinhole")  # lenses to try by name when the program refuses
    note: str = ""

    def names_cause(self, message, culprits):
        """Whether a message "CODE text" names the cause, and the camera where one is at fault."""
        named = any(re.search(pattern, message, re.IGNORECASE) for pattern in self.names)
        return named and (not culprits or any(re.search(rf"\b{re.escape(c)}\b", message) for c in culprits))


KINDS = {}
WIDE = ("ucm", "kannala4", "eucm")


def kind(group, names=(), **options):
    """Registers a function rng -> Recording under its own name; its doc string says what is wrong."""
    def register(make):
        kinds(group, names, {make.__name__: ((make.__doc__ or "").strip(), make)}, **options)
        return make
    return register


def kinds(group, names, made, **options):
    """Registers several: name -> (what is wrong, rng -> Recording)."""
    for name, (note, make) in made.items():
        KINDS[name] = Kind(name, group, make, list(names), note=note, **options)


def load():
    import kinds_board, kinds_cameras, kinds_clean, kinds_file, kinds_lenses, kinds_targets, kinds_time, kinds_views  # noqa: F401, E401
    return KINDS
