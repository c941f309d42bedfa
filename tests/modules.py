"""The modules of the project, as cmake/modules.txt lists them."""
import pathlib


def modules(root):
    """Their folders at the top, from the ground up."""
    lines = (pathlib.Path(root) / "cmake/modules.txt").read_text(encoding="utf-8").splitlines()
    folders = [line.split()[0] for line in lines if line and not line.startswith("#")]
    return list(dict.fromkeys(folder.split("/")[0] for folder in folders))


def sources(root, *suffixes):
    """Sorted paths of their files that end so; of .h and .cc unless suffixes are given."""
    wanted = suffixes or (".h", ".cc")
    return sorted(p for module in modules(root) for p in (pathlib.Path(root) / module).rglob("*") if p.suffix in wanted)
