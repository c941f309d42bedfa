"""What is promised after a run that was disturbed, and whether it was kept."""

import dataclasses
import re

import snapshot

# After a call that failed: bad data or device, out of resources, refused, try again. Never 1, never a signal.
ERROR_EXITS = {2, 3, 7, 75}
_PROGRESS = re.compile(r".* \d+/\d+ .*/s")
_TEMPORARY = re.compile(r"\.tmp-|\.old\b|\.lock\b|\.fetch-|\.mvstudio-[0-9a-f]{16}")


@dataclasses.dataclass
class States:
    """Of the box: before the run under test, and after a run that nobody disturbed."""
    old: dict
    new: dict
    exit: int = 0

    def __post_init__(self):
        both = set(self.old) | set(self.new)
        # The folder itself comes and goes with what is in it.
        self.changing = {p for p in both if self.old.get(p) != self.new.get(p) and not p.endswith("/")}
        self.known = both
        self.constant = {p: v for p, v in self.old.items() if self.new.get(p) == v and not p.endswith("/") and not snapshot.is_bookkeeping(p)}


def _data_is(state, reference, states):
    return all(state.get(p) == reference.get(p) for p in states.changing if not snapshot.is_bookkeeping(p))


def which_state(state, states):
    """'old', 'new' or None: of the results, without the files that tell about them."""
    if _data_is(state, states.new, states) and _data_is(state, states.old, states):
        return "new" if all(state.get(p) == states.new.get(p) for p in states.changing) else "old"
    if _data_is(state, states.new, states):
        return "new"
    return "old" if _data_is(state, states.old, states) else None


def in_steps(state, states, case, dead_disk=False):
    """Files that are published one after the other: each is the old one or the new one. On a disk that stays dead nothing can
    be taken back either."""
    return (case.steps or dead_disk) and all(state.get(p) in (states.old.get(p), states.new.get(p)) for p in states.changing
                              if not snapshot.is_bookkeeping(p))


def leftovers(state, states):
    return sorted(p for p in state if p not in states.known)


def foreign_damage(state, states):
    return sorted(p for p, value in states.constant.items() if state.get(p) != value)


def broken_bookkeeping(state, states):
    """Files about the results that are neither the old ones nor the new ones and not whole either; not those in work folders."""
    return sorted(p for p, value in state.items()
                  if snapshot.is_bookkeeping(p) and not _TEMPORARY.search(p) and str(value).startswith("broken"))


def message_problems(err):
    """A failure is told in one line that starts with `error: ` and names no hidden file."""
    lines = [line for line in err.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("error: ")]
    if len(errors) != 1:
        return [f"{len(errors)} error lines"]
    problems = []
    if errors[0] == "error: " or errors[0].startswith("error: :"):
        problems.append("names no place: " + errors[0][:120])
    if _TEMPORARY.search(errors[0]):
        problems.append("names a hidden file: " + errors[0][:160])
    noise = [line for line in lines if not line.startswith(("error: ", "warning", "hint: ", "[", "libpng ")) and not _PROGRESS.match(line)]
    if noise:
        problems.append("other lines: " + noise[0][:120])
    return problems


def after_error(outcome, state, states, case, kind):
    """Problems after a run in which a call failed. (name, detail) each."""
    problems = list(_always(state, states, case))
    extra = [p for p in leftovers(state, states) if not (case.grows and not _TEMPORARY.search(p))]
    if extra and kind not in ("unlink", "read-only"):  # nothing can be removed there
        problems.append(("leftover", ", ".join(extra[:4])))
    if not isinstance(outcome.exit, int):
        problems.append(("hang" if outcome.exit == "timeout" else "crash", str(outcome.exit)))
        return problems
    found = which_state(state, states)
    if outcome.exit == 6 and case.partial:  # an answer about what could be read
        return problems
    if outcome.exit == states.exit:
        whole = {p: v for p, v in state.items() if p in states.known} == states.new
        if state != states.new and not (kind in ("unlink", "read-only") and whole):
            unrecorded = _data_is(state, states.new, states) and (not extra or kind in ("unlink", "read-only"))
            if not unrecorded or "CLI-PROVENANCE" not in outcome.err:  # a result stands, whatever becomes of its record
                problems.append(("unrecorded" if unrecorded else "silent",
                                 f"exit {outcome.exit}, yet " + snapshot.difference(state, states.new)))
        return problems
    allowed = {7} if kind == "alloc" else ERROR_EXITS | ({6} if case.partial else set())
    if outcome.exit not in allowed:
        problems.append(("exit", f"{outcome.exit}: " + outcome.err.strip().splitlines()[-1][:160] if outcome.err.strip() else
                         str(outcome.exit)))
    if found is None and not case.grows and not in_steps(state, states, case, kind in ("full", "read-only")):
        problems.append(("mixed", snapshot.difference(state, states.old)))
    if found == "new" and states.old != states.new:
        problems.append(("late", f"exit {outcome.exit} although the result stands: " + outcome.err.strip()[:120]))
    problems += [("message", text) for text in message_problems(outcome.err)]
    return problems


def after_kill(outcome, state, states, case):
    problems = list(_always(state, states, case))
    if outcome.exit != "SIGKILL":
        problems.append(("exit", f"{outcome.exit} instead of our SIGKILL"))
    if which_state(state, states) is None and not case.grows and not in_steps(state, states, case):
        problems.append(("mixed", snapshot.difference({p: v for p, v in state.items() if p in states.known}, states.old)))
    return problems


def _always(state, states, case):
    damage = [p for p in foreign_damage(state, states) if not case.grows or p in case.foreign_paths()]
    if damage:
        yield "foreign", ", ".join(damage[:4])
    if broken_bookkeeping(state, states):
        yield "broken", ", ".join(broken_bookkeeping(state, states))


def after_rerun(outcome, state, states, case):
    """The run again, undisturbed: as if nothing had happened."""
    if outcome.exit != states.exit:
        if not case.overwrites and outcome.exit == 2 and which_state(state, states) == "new":
            return []
        return [("rerun", f"exit {outcome.exit}: " + outcome.err.strip()[:200])]
    expected = states.new
    if not case.repeats:  # it may have told about another way to the same result
        state, expected = ({p: v for p, v in s.items() if not snapshot.is_bookkeeping(p)} for s in (state, expected))
    if state != expected:
        return [("rerun", snapshot.difference(state, expected))]
    return []


def after_other_name(outcome, state, states, same):
    """An output under another name of its place is the same output; another is refused and changes nothing. The records hold
    the line that was typed."""
    def compared(s):
        return {p: "" if same and snapshot.is_bookkeeping(p) else v for p, v in s.items()}

    problems, expected = [], states.new if same else states.old
    if outcome.exit not in ({states.exit} if same else {2, 3}):
        problems.append(("exit", f"{outcome.exit}: " + outcome.err.strip()[:200]))
    if compared(state) != compared(expected):
        problems.append(("names", snapshot.difference(compared(state), compared(expected))))
    lines = [line for line in outcome.err.splitlines() if line.startswith("error: ")]
    if not same and len(lines) != 1:
        problems.append(("message", f"{len(lines)} error lines"))
    return problems


def after_pair(exits, errs, state, states, case):
    """Two runs of the same command at once."""
    problems = list(_always(state, states, case))
    allowed = {states.exit, 75}
    for mine, err in zip(exits, errs):
        refused = not case.overwrites and mine == 2 and "exists" in err
        if mine not in allowed and not refused:
            problems.append(("exit", f"{mine} beside another run: " + err.strip()[:160]))
    if states.exit not in exits:
        problems.append(("exit", f"neither run finished: {exits}"))
    if state != states.new:
        problems.append(("pair", snapshot.difference(state, states.new)))
    return problems
