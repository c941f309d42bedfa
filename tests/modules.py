"""The modules of the project, as cmake/modules.txt lists them."""
import pathlib


def targets(root):
    """Folders with a target of their own, from the ground up -> whether it needs libtorch."""
    lines = (pathlib.Path(root) / "cmake/modules.txt").read_text(encoding="utf-8").splitlines()
    return {line.split()[0]: line.endswith(" torch") for line in lines if line and not line.startswith("#")}


def folders(root):
    """Folders with sources -> what they hold, as cmake/folders.txt says."""
    lines = (pathlib.Path(root) / "cmake/folders.txt").read_text(encoding="utf-8").splitlines()
    return dict(line.split("  ", 1) for line in lines if line and not line.startswith("#"))


def modules(root):
    """Their folders at the top, from the ground up."""
    return list(dict.fromkeys(folder.split("/")[0] for folder in targets(root)))


def sources(root, *suffixes):
    """Sorted paths of their files that end so; of .h and .cc unless suffixes are given."""
    wanted = suffixes or (".h", ".cc")
    return sorted(p for module in modules(root) for p in (pathlib.Path(root) / module).rglob("*") if p.suffix in wanted)
